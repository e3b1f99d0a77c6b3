"""A map's numbers against its TIFF: windows and means, and isolines."""

import numpy as np
import pytest
import tifffile

from radiometry.frame.roi import Window
from radiometry.maps import read_uncertainty
from service.measurements.maps import Layout, read_layout, read_values
from tests.support.campaigns import published_campaign
from tests.support.measuring import read_map
from worker.maps.tiff import ROUNDING_REL, TILE_PX, encode_band


@pytest.fixture(scope="module")
def measured(sqlite_house):
    """A measurement of a noisy ramp with a saturated spot and a dark corner, with lanes and its map."""
    house = sqlite_house
    published_campaign(house, isos=(3200,))
    samples = np.tile(np.linspace(200.0, 2000.0, 96), (64, 1))
    samples += np.random.default_rng(5).normal(0.0, 3.0, samples.shape)
    samples[40:42, 60:62] = 9000.0
    samples[60:, :8] = 0.0
    content = house.frame_bytes(signal_dn=samples, exposure_time_s=0.02, f_number=4.0)
    campaign = house.campaign()
    frame = house.upload(campaign, content, role="field", filename="ramp.DNG")
    house.work()
    roi = {"polygon": [[8, 8], [40, 8], [40, 30], [8, 30]]}
    corners = [[8, 8], [88, 8], [88, 38], [8, 38]]
    grid = {"corners": corners, "lanes": 1, "lane_width_m": 3.0, "spacing_m": 20}
    asked = {"frame_id": frame["id"], "roi": roi, "grid": grid, "products": ["map"]}
    return house.measure(**asked)


@pytest.fixture
def house(sqlite_house):
    """One for all: nothing here depends on the database."""
    return sqlite_house


def values_of(answer):
    return np.array(answer["values"], dtype=np.float32)


def test_every_value_is_the_tiffs_to_the_last_bit(house, measured, plane):
    answer = house.get(f"/v1/measurements/{measured['id']}/map.json")
    assert (answer["unit"], answer["height_px"], answer["width_px"]) == ("cd/m2", 64, 96)
    assert np.array_equal(values_of(answer), plane, equal_nan=True)
    assert answer["values"][40][60] is None


def test_a_window_and_its_means(house, measured, plane):
    asked = {"top": 3, "left": 10, "height": 13, "width": 21, "step": 4}
    answer = house.get(f"/v1/measurements/{measured['id']}/map.json", **asked)
    part = plane[3:15, 10:30]
    assert values_of(answer) == pytest.approx(part.reshape(3, 4, 5, 4).mean((1, 3)), rel=1e-6)
    whole = house.get(f"/v1/measurements/{measured['id']}/map.json", step=8)
    assert values_of(whole).shape == (8, 12)
    # a square with an unknown pixel is unknown: the spot and the neighbours that are made of it
    assert whole["values"][5][7] is None


def test_a_value_has_the_uncertainty_that_a_single_pixel_was_given(house, measured):
    """``min`` is a pixel of the region, with the uncertainty that the measurement gave it."""
    said = house.get(f"/v1/measurements/{measured['id']}/map.json", step=8)["uncertainty"]
    pixel, mean = measured["min"], measured["mean"]
    u = np.hypot(np.hypot(said["u_rel"] * pixel["value"], said["u_constant"]), said["u_pixel"])
    assert u == pytest.approx(pixel["standard_uncertainty"], rel=1e-9)
    shared = np.hypot(said["u_rel"] * mean["value"], said["u_constant"])
    assert shared == pytest.approx(measured["shared_u_cd_m2"], rel=1e-9)


def test_the_layer_of_the_uncertainty_is_that_of_the_values(house, measured):
    """U = k u / v: noise alone shrinks with the square, and where nothing is known there is none."""
    address = f"/v1/measurements/{measured['id']}/map.json"
    values, layer = house.get(address), house.get(address, layer="expanded_uncertainty_rel")
    assert (layer["layer"], layer["unit"], "uncertainty" in layer) == ("expanded_uncertainty_rel", "1", False)
    said, value = values["uncertainty"], values["values"][10][10]
    assert value < measured["mean"]["value"]
    u = np.hypot(np.hypot(said["u_rel"] * value, said["u_constant"]), said["u_pixel"])
    assert layer["values"][10][10] == pytest.approx(said["coverage_factor"] * u / value, rel=1e-6)
    assert layer["values"][40][60] is None
    square = house.get(address, layer="expanded_uncertainty_rel", step=8)["values"][1][1]
    assert said["coverage_factor"] == measured["coverage_factor"]
    assert 1.96 * said["u_rel"] < square < layer["values"][10][10]
    assert any("Vignetting is not corrected" in note for note in layer["notes"])


def test_what_is_no_window_of_the_map_is_refused(house, measured):
    address = f"/v1/measurements/{measured['id']}/map.json"
    assert "64 rows and 96 columns" in house.get(address, status=422, top=64)["detail"]
    assert "no whole square" in house.get(address, status=422, step=65)["detail"]
    assert house.get(address, status=422, step=0)["errors"][0]["field"] == "query.step"


def write_tiles(path, plane):
    """Tiles of a plane one after the other; the layout of the file."""
    tiles = [
        tile for top in range(0, len(plane), TILE_PX) for tile in encode_band(plane[top : top + TILE_PX])
    ]
    path.write_bytes(b"".join(tiles))
    sizes = [len(tile) for tile in tiles]
    return Layout(
        height_px=plane.shape[0],
        width_px=plane.shape[1],
        tile_px=TILE_PX,
        predicted=True,
        offsets=tuple(int(at) for at in np.cumsum([0, *sizes[:-1]])),
        sizes=tuple(sizes),
        description="{}",
    )


@pytest.mark.parametrize("transposed", [False, True])
@pytest.mark.parametrize(
    ("window", "step"),
    [((0, 0, 300, 600), 1), ((250, 250, 262, 522), 1), ((1, 3, 300, 600), 7), ((255, 511, 257, 513), 2)],
)
def test_squares_may_lie_across_tiles(tmp_path, window, step, transposed):
    plane = np.random.default_rng(1).uniform(0.0, 9.0, (300, 600)).astype(np.float32)
    top, left, bottom, right = window
    if transposed:
        plane, top, left, bottom, right = plane.T.copy(), left, top, right, bottom
    layout = write_tiles(tmp_path / "map", plane)
    part = Window(row0=top, col0=left, height=bottom - top, width=right - left)
    found = read_values(tmp_path / "map", layout, part, step=step)
    rows, cols = (bottom - top) // step, (right - left) // step
    part = plane[top : top + rows * step, left : left + cols * step].astype(np.float64)
    np.testing.assert_allclose(found, part.reshape(rows, step, cols, step).mean((1, 3)), rtol=ROUNDING_REL)


@pytest.mark.parametrize("predictor", [1, 3])
def test_the_layout_is_that_of_the_file(tmp_path, predictor):
    plane = np.arange(300 * 280, dtype=np.float32).reshape(300, 280)
    options = {"tile": (256, 256), "compression": "zlib", "predictor": predictor, "description": "{}"}
    tifffile.imwrite(tmp_path / "map.tif", plane, **options)
    layout = read_layout(tmp_path / "map.tif")
    whole = Window(row0=0, col0=0, height=300, width=280)
    assert np.array_equal(read_values(tmp_path / "map.tif", layout, whole, step=1), plane)


def test_an_index_has_no_such_uncertainty():
    assert read_uncertainty({"index": "ndvi", "bands": []}) is None


def ask(house, measured, name, **query):
    return house.get(f"/v1/measurements/{measured['id']}/{name}", **query)


@pytest.fixture(scope="module")
def plane(sqlite_house, measured):
    return read_map(sqlite_house, measured)[0]


def test_isolines_of_a_ramp_are_upright_lines(house, measured, plane):
    levels = [float(np.mean(plane[8:38, col])) for col in (30, 60)]
    found = ask(house, measured, "isolines.geojson", levels=",".join(map(str, levels)), step=4)
    assert (found["coordinates_in"], found["step_px"], found["area"]) == ("pixel", 4, "frame")
    for feature, col in zip(found["features"], (30, 60), strict=True):
        longest = max(feature["geometry"]["coordinates"], key=len)
        assert np.median([x for x, _ in longest]) == pytest.approx(col + 0.5, abs=1.0)
        assert feature["properties"]["place_u_px"] > 0
    assert 0.0 < found["unknown_share"] < 0.05
    road = ask(house, measured, "isolines.geojson", levels=str(levels[0]), step=4, coordinates="road_m")
    (line,) = road["features"][0]["geometry"]["coordinates"]
    assert road["area"] == "grid"
    assert np.median([x for x, _ in line]) == pytest.approx((30.5 - 8) / 4, abs=0.3)


@pytest.mark.parametrize(
    ("kept", "other"), [("map.json?step=8", "top=8"), ("isolines.geojson?step=4", "levels=5")]
)
def test_an_answer_is_kept_for_ever_and_another_question_has_another(house, measured, kept, other):
    address = f"/v1/measurements/{measured['id']}/{kept}"
    answer = house.http.get(address)
    assert "immutable" in answer.headers["cache-control"]
    named = {"If-None-Match": answer.headers["etag"]}
    assert house.http.get(address, headers=named).status_code == 304
    assert house.http.get(f"{address}&{other}", headers=named).status_code == 200


def test_levels_and_squares_are_chosen_and_said(house, measured):
    found = ask(house, measured, "isolines.geojson")
    levels = [feature["properties"]["level"] for feature in found["features"]]
    assert 2 <= len(levels) <= 8
    assert levels == sorted(levels)
    assert found["step_px"] >= 1
    for query, said in (
        ({"levels": "1,nan"}, "finite"),
        ({"levels": ""}, "1 to 20"),
        ({"step": 64}, "2 x 2 squares"),
    ):
        assert said in ask(house, measured, "isolines.geojson", status=422, **query)["detail"]
    assert "no place" in ask(house, measured, "isolines.geojson", coordinates="wgs84", status=404)["detail"]
