"""A campaign whose frames obey N = D + K X exactly, and its fit."""

from dataclasses import replace

from radiometry.frame.exposure import Exposure
from radiometry.frame.statistics import ChannelStatistics
from radiometry.luminance import method as luminance
from radiometry.luminance.rows import FrameRow, Params, Reading

K, DARK = 30.0, 256.0
SCENES = {"bright": 50.0, "middle": 5.0, "dim": 0.5}
READINGS = tuple(
    Reading(scene=s, quantity="luminance", value=v, expanded_uncertainty_rel=0.03, coverage_factor=2.0)
    for s, v in SCENES.items()
)


def statistics(mean_dn, *, saturated=0.0, white=4095.0, channel="grey"):
    return (
        ChannelStatistics(
            channel=channel,
            n=10000,
            min_dn=0,
            max_dn=4095,
            mean_dn=mean_dn,
            median_dn=mean_dn,
            std_dn=20.0,
            saturated_share=saturated,
            zero_share=0.0,
            black_level_dn=DARK,
            white_level_dn=white,
        ),
    )


def light(scene, f_number, *, time_s=None, iso=3200.0, name=None, k=K, mean_dn=None, **changes):
    """A frame that obeys N = D + K X exactly."""
    time_s = time_s or 0.1 * 5.0 / SCENES[scene]
    exposure = Exposure(exposure_time_s=time_s, f_number=f_number, iso=iso)
    signal = DARK + k * time_s * iso * SCENES[scene] / f_number**2 if mean_dn is None else mean_dn
    row = FrameRow(
        frame=name or f"{scene}-{iso:g}-{f_number:g}",
        role="light",
        scene=scene,
        exposure=exposure,
        statistics=statistics(signal),
    )
    return replace(row, **changes)


def dark(name, *, mean_dn=DARK, time_s=0.1, iso=3200.0):
    exposure = Exposure(exposure_time_s=time_s, f_number=4.0, iso=iso)
    return FrameRow(frame=name, role="dark", scene=None, exposure=exposure, statistics=statistics(mean_dn))


LIGHTS = tuple(light(scene, f) for scene in SCENES for f in (5.6, 8.0, 16.0))
DARKS = tuple(dark(f"dark-{t:g}-{n}", time_s=t) for t in (0.01, 0.1, 1.0) for n in range(2))
ROWS = LIGHTS + DARKS
PARAMS = Params(meter_repeatability_rel=0.01, f_number_u_rel=0.015)


def fit(rows=ROWS, readings=READINGS, params=PARAMS):
    return luminance.fit(rows, readings, params)


def raised(result, flag):
    return [found.where for found in result.flags if found.flag == flag]


def point(result, frame):
    return next(p for p in result.points if p.frame == frame)
