"""Panel and flight captures of a simulated Sequoia, cut to small frames, as rows of a campaign."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np

from radiometry.fitting.evidence import Region
from radiometry.frame import FrameHeader
from radiometry.frame.multispectral import GainMeasurement, Multispectral, SunshineCounts, SunshineRecord
from radiometry.frame.roi import Polygon
from radiometry.reflectance import method as reflectance
from simulation.camera import change
from simulation.sequoia import BANDS, SEQUOIA, capture

NAMES = tuple(BANDS)
CAMERA = change(SEQUOIA, height_px=120, width_px=160)
NOON = datetime(2018, 6, 13, 11, 0, tzinfo=UTC)
PANEL = Polygon.from_points([(50, 40), (110, 40), (110, 80), (50, 80)])
PANEL_R = {"green": 0.18, "red": 0.18, "red_edge": 0.19, "nir": 0.20}
READINGS = tuple(
    reflectance.Reading(panel="P1", band=band, reflectance=value, standard_uncertainty=0.002)
    for band, value in PANEL_R.items()
)
# The procedure's own table.
TABLE = tuple(
    GainMeasurement(gain_index=index, integration_time_s=0.6, ch0=ch0, ch1=ch1)
    for index, ch0, ch1 in ((0, 11, 3), (1, 330, 84), (2, 3990, 1506), (3, 65535, 38630))
)


def take(random, surface, *, camera=CAMERA, minutes=0.0, role="panel", polygon=PANEL, prefix="", **light):
    """Rows of one capture; ``surface`` per band."""
    prefix = prefix or f"{role}-{minutes:g}"
    shots = capture(
        camera,
        random,
        reflectance=surface,
        taken_at=NOON + timedelta(minutes=minutes),
        capture_id=prefix,
        **light,
    )
    return [row(f"{prefix}-{band}", shot, role=role, polygon=polygon) for band, shot in shots.items()]


def row(name, shot, *, role="panel", polygon=PANEL, header=None):
    header = header or shot.header
    features = extract(shot.frame, polygon, header=header, exposure=shot.exposure)
    return reflectance.FrameRow(
        frame=name,
        role=role,
        scene=None,
        header=header,
        exposure=shot.exposure,
        statistics=None,
        features=features,
    )


def extract(frame, polygon, *, header, exposure):
    region = Region(name="", polygon=polygon)
    return reflectance.extract(frame, [region], header=header, exposure=exposure).features


def seeded(seed=1):
    return np.random.default_rng(seed)


def make_record(time_us=0, ch0=430, gain_index=1, integration_time_s=0.1, **more):
    return SunshineRecord(
        time_us=time_us,
        ch0=ch0,
        ch1=ch0 // 4,
        gain_index=gain_index,
        integration_time_s=integration_time_s,
        **more,
    )


def make_band(*records, gains=TABLE, **more):
    counts = SunshineCounts(record_bytes=28, cut_short=False, records=records, gains=gains)
    return Multispectral(system="sequoia", band="green", band_name="Green", counts=counts, **more)


def flags_of(raised):
    return {each.flag for each in raised}


def make_header(band, **more):
    return FrameHeader(
        **{
            "container": "tiff",
            "decoder": "stilb",
            "rendered": False,
            "compression": "none",
            "bits_per_sample": 16,
            "width_px": 160,
            "height_px": 120,
            "cfa": "grey",
            "black_level_dn": (4800.0,),
            "black_level_origin": "tag",
            "white_level_dn": (65520.0,),
            "white_level_origin": "camera",
            "multispectral": band,
        }
        | more
    )


def panel(seed=1, **more):
    return take(seeded(seed), PANEL_R, **more)


def k_of(fit, band="green"):
    return next(each for each in fit.band_fits if each.coefficient.band == band)


def change_band(rows, **changes):
    return [
        replace(
            each, header=replace(each.header, multispectral=replace(each.header.multispectral, **changes))
        )
        for each in rows
    ]


def change_features(rows, **changes):
    return [replace(each, features=replace(each.features, **changes)) for each in rows]
