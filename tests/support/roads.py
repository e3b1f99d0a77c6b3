"""A small road under two lamps: its light by hand, its frames, and its control points."""

import numpy as np

from tests.support.campaigns import K_TRUE, published_campaign
from tests.support.frames import BLACK, WHITE, write_raw
from tests.support.meters import CERTIFICATE

RULE = "EN 13201-2:2015"
SPACING_M, WIDTH_M, PX_PER_M, MARGIN_M = 30.0, 6.0, 16, 4.0
REFLECTANCE = 0.3
SITE = {
    "rows": [{"y_m": -1.0, "height_m": 8.0, "spacing_m": SPACING_M}],
    "strips": [
        {"name": "1", "kind": "lane", "y_m": 0.0, "width_m": 3.0},
        {"name": "2", "kind": "lane", "y_m": 3.0, "width_m": 3.0},
    ],
}
REQUIREMENT = {"rule": RULE, "road_class": "C4"}
CONDITIONS = {
    "surface": "dry",
    "lamp_kind": "led",
    "mains_frequency_hz": 50,
    "power_w": 90.0,
    "reflectance": REFLECTANCE,
}
POINTS_M = (
    (1.5, 1.5),
    (4.5, 4.5),
    (10.5, 1.5),
    (13.5, 5.5),
    (16.5, 0.5),
    (19.5, 4.5),
    (25.5, 1.5),
    (28.5, 4.5),
)
METER = {
    "kind": "illuminance",
    "make": "Konica Minolta",
    "model": "T-10A",
    "serial": "40027731",
    "certificate": CERTIFICATE | {"number": "E-2026-0118", "expanded_uncertainty_rel": 0.04},
}
_EXPOSURE_S, _F_NUMBER, _ISO = 0.02, 2.0, 3200


def illuminate(x_m, y_m):
    """E in lx of four lamps of one row."""
    places = SPACING_M * np.arange(-1, 3)
    squared = (np.asarray(x_m)[..., None] - places) ** 2 + (np.asarray(y_m)[..., None] + 1.0) ** 2
    return (3000.0 * 8.0 / (64.0 + squared) ** 1.5).sum(axis=-1)


def write_road_frame(folder, *, seed=1, noise_dn=1.0):
    """A frame from straight above, x to the right and y downwards."""
    shape = int((WIDTH_M + 2 * MARGIN_M) * PX_PER_M), int((SPACING_M + 2 * MARGIN_M) * PX_PER_M)
    y, x = ((np.indices(shape) + 0.5) / PX_PER_M) - MARGIN_M
    luminance = illuminate(x, y) * REFLECTANCE / np.pi
    signal = K_TRUE * _EXPOSURE_S * _ISO * luminance / _F_NUMBER**2
    mosaic = np.random.default_rng(seed).normal(BLACK + signal, noise_dn)
    samples = np.clip(np.rint(mosaic), 0, WHITE).astype(np.uint16)
    settings = {"exposure_time_s": _EXPOSURE_S, "f_number": _F_NUMBER, "iso": _ISO}
    return write_raw(folder / f"road-{seed}.DNG", samples, **settings)


def mark(x_m, y_m):
    return {"x_px": (x_m + MARGIN_M) * PX_PER_M, "y_px": (y_m + MARGIN_M) * PX_PER_M, "x_m": x_m, "y_m": y_m}


MARKS = [mark(x, y) for x in (0.0, SPACING_M / 2, SPACING_M) for y in (0.0, WIDTH_M)]


def list_points(meter_id, **readings):
    """Control points that read what the lamps give, or what is said of them."""
    points = []
    for number, (x, y) in enumerate(POINTS_M, start=1):
        lux = readings.get(f"P{number}", float(illuminate(x, y)))
        points.append(
            {
                "name": f"P{number}",
                "x_m": x,
                "y_m": y,
                "quantity": "illuminance",
                "unit": "lx",
                "values": [lux, lux * 1.01],
                "meter_id": meter_id,
            }
        )
    return points


def state_road(house, *, frames=2, publish=True, **changes):
    """A road with its frames and control points, under a K that is in force; as it is answered."""
    if publish:
        published_campaign(house, isos=(3200,))
    night = house.campaign(kind="measurement")
    ids = [
        house.upload(night, write_road_frame(house.folder, seed=n).read_bytes(), role="field")["id"]
        for n in range(frames)
    ]
    house.work()
    stated = {"name": "Harbour Street", "site": SITE, "requirement": REQUIREMENT, "conditions": CONDITIONS}
    stated |= {"frames": [{"frame_id": each, "marks": MARKS} for each in ids]} | changes
    made = house.post("/v1/roads", stated)
    meter_id = house.post("/v1/meters", METER)["id"]
    house.put(f"/v1/roads/{made['id']}/points", list_points(meter_id))
    return house.get(f"/v1/roads/{made['id']}")


def evaluate(house, road):
    made = house.finish(f"/v1/roads/{road['id']}/evaluate", None)
    return house.get(f"/v1/roads/{road['id']}/results/{made['number']}")


def evaluate_road(house):
    """A road as `state_road` states it, evaluated."""
    return evaluate(house, state_road(house))
