"""A campaign whose frames obey N = D + K X exactly, and its fit."""

from dataclasses import replace

from radiometry.luminance import method as luminance
from radiometry.luminance.rows import Params, Reading
from tests.radiometry import evidence
from tests.radiometry.evidence import DARK, SCENES, K

READINGS = tuple(
    Reading(scene=s, quantity="luminance", value=v, expanded_uncertainty_rel=0.03, coverage_factor=2.0)
    for s, v in SCENES.items()
)


def statistics(mean_dn, *, saturated=0.0, white=4095.0, channel="grey"):
    levels = {"max_dn": 4095, "median_dn": mean_dn, "saturated_share": saturated, "white_level_dn": white}
    return (evidence.statistics(mean_dn, channel=channel, **levels),)


def light(scene, f_number, *, time_s=None, iso=3200.0, name=None, k=K, mean_dn=None, **changes):
    row = evidence.light(scene, f_number, name=name, time_s=time_s, iso=iso, luminance=SCENES.get(scene, 1.0))
    if mean_dn is None:
        mean_dn = DARK + k * row.exposure.exposure_time_s * iso * SCENES[scene] / f_number**2
    return replace(row, **{"statistics": statistics(mean_dn)} | changes)


def dark(name, *, mean_dn=DARK, time_s=0.1, iso=3200.0):
    return replace(evidence.dark(name, time_s=time_s, iso=iso), statistics=statistics(mean_dn))


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
