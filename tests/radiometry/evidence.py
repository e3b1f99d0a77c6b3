"""Frames of a luminance campaign by hand: N = D + K X to the last digit, noise as said."""

from dataclasses import replace

from radiometry.frame.exposure import Exposure
from radiometry.frame.roi import Polygon
from radiometry.frame.statistics import ChannelStatistics
from radiometry.frame.verdicts import ReviewedFrame
from radiometry.luminance.rows import FrameRow, Reading

K, DARK, WHITE = 30.0, 256.0, 4095.0
SPAN = WHITE - DARK
SCENES = {"bright": 50.0, "middle": 5.0, "dim": 0.5}
REGION = Polygon.from_points([(10, 10), (60, 10), (60, 50), (10, 50)])
FORMAT = (640, 480, "RGGB")


def statistics(mean_dn, **changes):
    row = ChannelStatistics(
        channel="grey",
        n=10000,
        min_dn=0,
        max_dn=round(mean_dn) + 80,
        mean_dn=mean_dn,
        median_dn=float(round(mean_dn)),
        std_dn=20.0,
        saturated_share=0.0,
        zero_share=0.0,
        black_level_dn=DARK,
        white_level_dn=WHITE,
    )
    return replace(row, **changes)


def light(scene, f_number, *, name=None, time_s=None, iso=3200.0, signal_dn=None, luminance=None, **changes):
    """A light frame; ``signal_dn`` above dark where it is not to follow from the equation."""
    luminance = luminance or SCENES[scene]
    time_s = time_s or 0.1 * 5.0 / luminance
    if signal_dn is None:
        signal_dn = K * time_s * iso * luminance / f_number**2
    return FrameRow(
        frame=name or f"{scene}-{iso:g}-{f_number:g}",
        role="light",
        scene=scene,
        exposure=Exposure(exposure_time_s=time_s, f_number=f_number, iso=iso),
        statistics=(statistics(DARK + signal_dn, **changes),),
    )


def dark(name, *, mean_dn=DARK, time_s=0.1, iso=3200.0, **changes):
    return FrameRow(
        frame=name,
        role="dark",
        scene=None,
        exposure=Exposure(exposure_time_s=time_s, f_number=4.0, iso=iso),
        statistics=(statistics(mean_dn, **changes),),
    )


def reading(scene, value=None, *, quantity="luminance"):
    value = SCENES[scene] if value is None else value
    return Reading(
        scene=scene,
        quantity=quantity,
        value=value,
        meter="meter 1",
        expanded_uncertainty_rel=0.03,
        coverage_factor=2.0,
    )


def taken(row, **changes):
    """A row's frame as its campaign knows it, whatever the method; a panel's row names no scene."""
    frame = ReviewedFrame(
        frame=row.frame,
        role=row.role,
        scene=getattr(row, "scene", None),
        state="extracted",
        refusal="",
        flags=(),
        format=FORMAT,
        region=REGION,
    )
    return replace(frame, **changes)


LIGHTS = tuple(light(scene, f) for scene in SCENES for f in (5.6, 8.0, 16.0))
DARKS = tuple(dark(f"dark-{t:g}-{n}", time_s=t) for t in (0.01, 0.1, 1.0) for n in range(3))
ROWS = LIGHTS + DARKS
READINGS = tuple(reading(scene) for scene in SCENES)
