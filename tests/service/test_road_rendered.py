"""A road as another program renders it: lamps by a table, the lens of OpenCV's pictures, DNGs by tifffile."""

import io

import numpy as np
import pytest
import tifffile
from scipy.ndimage import map_coordinates

from radiometry.road.site import Row, Site, Strip
from tests.radiometry.road.simulated import Luminaire, Truth
from tests.support.campaigns import K_TRUE, calibrate, published_campaign
from tests.support.every_method import BOARD, begin, upload_views
from tests.support.house import CAMERA
from tests.support.roads import METER, RULE, evaluate

# what OpenCV published of the camera behind its pictures of a board, which the product fits from five of them
FOCAL, MIDDLE, BEND = 535.9157, (342.2832, 235.5708), (-0.26637, -0.03859, 0.00178, -0.00028, 0.23839)
SHAPE = 480, 640
SPACING_M, WIDTH_M = 28.0, 7.0
# of a lux meter whose certificate says 2 %, and of its readings to 3 %
LUX_ERRORS = 0.02 + 0.03 * np.array([1, -1, -1, 1, 1, -1, -1, 1])
_EXPOSURE_S, _F_NUMBER, _ISO, _BLACK, _WHITE = 0.5, 2.0, 3200, 256, 4095


def bend(x, y):
    """Brown's model, by hand."""
    k1, k2, p1, p2, k3 = BEND
    r2 = x**2 + y**2
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x**2), y * radial + p1 * (
        r2 + 2 * y**2
    ) + 2 * p2 * x * y


def straighten(x, y):
    u, v = x, y
    for _ in range(60):
        seen = bend(u, v)
        u, v = u + x - seen[0], v + y - seen[1]
    return u, v


class View:
    """A camera above the road that leans along and across it; x to the right, y downwards."""

    def __init__(self, along_deg, across_deg, height_m):
        a, b = np.radians([along_deg, across_deg])
        over = np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]])
        side = np.array([[1, 0, 0], [0, np.cos(b), -np.sin(b)], [0, np.sin(b), np.cos(b)]])
        self.turn, self.place = over @ side, np.array([SPACING_M / 2, WIDTH_M / 2, -height_m])

    def see(self, x_m, y_m):
        """Place in the picture, counted from its corner."""
        a, b, c = np.moveaxis((np.stack([x_m, y_m, 0 * x_m], axis=-1) - self.place) @ self.turn, -1, 0)
        return tuple(FOCAL * each + at + 0.5 for each, at in zip(bend(a / c, b / c), MIDDLE, strict=True))

    def meet(self):
        """Place on the road of each pixel's middle."""
        row, col = np.indices(SHAPE)
        x, y = straighten((col - MIDDLE[0]) / FOCAL, (row - MIDDLE[1]) / FOCAL)
        rays = np.stack([x, y, np.ones_like(x)], axis=-1) @ self.turn.T
        reach = -self.place[2] / rays[..., 2]
        return self.place[0] + reach * rays[..., 0], self.place[1] + reach * rays[..., 1]


def make_truth():
    site = Site(
        rows=(Row(y_m=-1.0, height_m=7.0, spacing_m=SPACING_M),),
        strips=tuple(Strip(name=str(n + 1), kind="lane", y_m=3.5 * n, width_m=3.5) for n in range(2)),
    )
    return Truth(site, Luminaire.draw(np.random.default_rng(4), lumen=9000.0), rho=0.2, b1=0.15, patches=0.05)


def write_dng(mosaic):
    out = io.BytesIO()
    stated = [
        (271, 2, 0, CAMERA["make"], True),
        (272, 2, 0, CAMERA["model"], True),
        (33421, 3, 2, (2, 2), True),
        (33422, 1, 4, (0, 1, 1, 2), True),
        (33434, 5, 1, (1, 2), True),
        (33437, 5, 1, (20, 10), True),
        (34855, 3, 1, _ISO, True),
        (36867, 2, 0, "2026:05:01 21:00:00", True),
        (50706, 1, 4, (1, 4, 0, 0), True),
        (50708, 2, 0, "DJI FC6520", True),
        (50714, 3, 1, _BLACK, True),
        (50717, 3, 1, _WHITE, True),
        (50735, 2, 0, CAMERA["serial"], True),
    ]
    tifffile.imwrite(out, mosaic, photometric=32803, extratags=stated, metadata=None, software="render")
    return out.getvalue()


def pave(truth, random):
    """Luminance every 0.25 m from (-20, -20) on, and patches of 0.5 m."""
    y, x = (np.indices((280, 280)) * 0.25 - 20.0).reshape(2, -1)
    patches = np.exp(truth.patches * random.standard_normal((140, 140)))
    return truth.light(np.column_stack([x, y]))[1].reshape(280, 280), patches


def render(luminances, patches, view, random):
    x, y = view.meet()
    luminance = map_coordinates(luminances, [(y + 20.0) / 0.25, (x + 20.0) / 0.25])
    at = [np.floor((each + 20.0) / 0.5).astype(int) for each in (y, x)]
    signal = K_TRUE * _EXPOSURE_S * _ISO * luminance * patches[at[0], at[1]] / _F_NUMBER**2
    assert signal.max() < _WHITE - _BLACK
    noisy = _BLACK + random.poisson(signal * 4) / 4 + random.normal(0, 2, SHAPE)
    return write_dng(np.clip(np.rint(noisy), 0, _WHITE).astype(np.uint16))


def mark(view, random):
    for x in (0.0, SPACING_M / 2, SPACING_M):
        for y in (0.0, WIDTH_M):
            col, row = (float(each) + random.normal(0, 0.7) for each in view.see(np.array(x), np.array(y)))
            yield {"x_px": col, "y_px": row, "x_m": x, "y_m": y, "u_m": 0.05}


def publish_lens(house):
    campaign = begin(house, "geometry", CAMERA, target=BOARD)
    upload_views(house, campaign, (1, 3, 4, 5, 6))
    version = calibrate(house, campaign)
    house.publish(version)
    return version["id"]


@pytest.mark.either_database
def test_a_rendered_road_is_found_within_its_uncertainty(house):
    random, truth = np.random.default_rng(11), make_truth()
    published_campaign(house, isos=(_ISO,))
    lens = publish_lens(house)
    night = house.campaign(kind="measurement")
    pavement, frames = pave(truth, random), []
    for view in (View(4.0, -3.0, 26.0), View(-5.0, 2.0, 25.0)):
        sent = house.upload(night, render(*pavement, view, random), role="field", filename="r.DNG")
        frames.append({"frame_id": sent["id"], "marks": list(mark(view, random))})
    house.work()
    lanes = [{"name": str(n + 1), "kind": "lane", "y_m": 3.5 * n, "width_m": 3.5} for n in range(2)]
    stated = {
        "name": "Rendered Street",
        "site": {"rows": [{"y_m": -1.0, "height_m": 7.0, "spacing_m": SPACING_M}], "strips": lanes},
        "requirement": {"rule": RULE, "road_class": "C4"},
        "conditions": {"surface": "dry", "lamp_kind": "led"},
        "frames": frames,
    }
    road, meter = house.post("/v1/roads", stated), house.post("/v1/meters", METER)["id"]
    grid = np.array([(each["x_m"], each["y_m"]) for each in road["grid"]])
    light, places = truth.light(grid)[0], grid[[1, 14, 26, 33, 45, 47, 52, 57]] + (0.2, 0.1)
    read = truth.light(places)[0] * np.exp(LUX_ERRORS)
    points = [
        {"name": f"P{n}", "x_m": x, "y_m": y, "quantity": "illuminance", "unit": "lx", "values": [lux]}
        | {"meter_id": meter}
        for n, ((x, y), lux) in enumerate(zip(places.tolist(), read.tolist(), strict=True), start=1)
    ]
    house.put(f"/v1/roads/{road['id']}/points", points)
    result = evaluate(house, road)
    assert {each["lens"] for each in result["frames"]} == {lens}
    figures = {each["figure"]: each for each in result["figures"]}
    for name, true in (("e_av", light.mean()), ("u_0", light.min() / light.mean())):
        assert figures[name]["low"] < true < figures[name]["high"], name
        assert figures[name]["expanded_uncertainty"] < 0.1 * true
    # barrel distortion moves the ends of the field by a metre; the marks know them to a tenth of that
    assert result["grid"]["place_u_m"] < 0.2
    assert {each["state"] for each in result["control"]} == {"agrees"}
