"""A real RedEdge over HTTP: a panel capture with its drawn regions, and a flight in the same campaign."""

import json
import math
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from tests.support.data import data_file
from tests.support.measuring import measure, read_map

BANDS = ("blue", "green", "red", "nir", "red_edge")
CAMERA = {"make": "MicaSense", "model": "RedEdge", "serial": "1777777"}
# The panel's corners in band 1, and by how much the other bands see it moved, (x, y).
CORNERS = ((809, 613), (648, 615), (646, 454), (808, 452))
SHIFTS = dict(zip(BANDS, ((0, 0), (-35, 10), (-35, 38), (20, 43), (0, 20)), strict=True))
# What the maker's own library makes of the same files.
RADIANCE = dict(zip(BANDS, (0.17028382, 0.17940027, 0.16221727, 0.10647021, 0.13081078), strict=True))
IRRADIANCE = dict(zip(BANDS, (0.79845, 0.81682, 0.74944, 0.54834, 0.61336), strict=True))
ALBEDO = dict(zip(BANDS, (0.67, 0.69, 0.68, 0.61, 0.67), strict=True))
LEVEL = dict(zip(BANDS, (0.886, 0.876, 0.869, 0.862, 0.866), strict=True))
DLS = dict(zip(BANDS, (1.084825, 0.983995, 0.921404, 0.486932, 0.771330), strict=True))
PANEL = {
    "serial": "RP02-1603036-SC",
    "measured_on": "2016-03-14",
    "bands": [
        {"band": band, "reflectance": albedo, "standard_uncertainty": 0.005}
        for band, albedo in ALBEDO.items()
    ],
}


def name(capture, band):
    return f"0000SET_000_IMG_000{capture}_{BANDS.index(band) + 1}.tif"


def send(house, campaign, capture, band, **query):
    content = data_file(f"rededge/{name(capture, band)}").read_bytes()
    return house.upload(campaign, content, filename=name(capture, band), **query)


@pytest.fixture(scope="module")
def campaign(sqlite_house):
    """The flight's frames are there before the fit, and nobody draws anything on them."""
    house = sqlite_house
    camera = house.camera(**CAMERA)
    house.post("/v1/panels", PANEL)
    made = house.post("/v1/campaigns", {"camera_id": camera["id"], "method": "reflectance"})
    for band, (dx, dy) in SHIFTS.items():
        region = json.dumps([[x + dx, y + dy] for x, y in CORNERS])
        send(house, made, 0, band, role="panel", roi=region)
    for band in ("red", "nir"):
        send(house, made, 1, band, role="field")
    house.work()
    return made


@pytest.fixture(scope="module")
def frames(sqlite_house, campaign):
    items = sqlite_house.get(f"/v1/campaigns/{campaign['id']}/frames")["items"]
    return {(frame["role"], frame["band"]): frame for frame in items}


@pytest.fixture(scope="module")
def version(sqlite_house, campaign):
    return sqlite_house.fit(campaign)


@pytest.mark.parametrize("band", BANDS)
def test_a_panel_frame_gives_the_published_radiance_and_the_light_sensor_s_reading(frames, band):
    frame = frames["panel", band]
    (row,) = frame["statistics"]
    assert (row["channel"], row["i_sq_unit"]) == (band, "W/(m2*sr*nm)")
    assert row["i_sq"] == pytest.approx(RADIANCE[band], rel=1e-3)
    sunshine = frame["sunshine"]
    assert sunshine["i_ss"] == pytest.approx(DLS[band], abs=1e-6)
    assert (sunshine["unit"], sunshine["serial"], sunshine["readings"]) == ("W/(m2*nm)", "DL03-1706120-SC", 1)


def test_flight_frames_are_no_part_of_the_version_and_wait_for_no_region(frames, version):
    names = {frame["frame"] for frame in version["inputs"]["frames"]}
    assert names == {name(0, band) for band in BANDS}
    assert frames["field", "nir"]["verdict"] == {"outcome": "pass", "reasons": []}


@pytest.mark.parametrize("band", BANDS)
def test_k_is_the_light_over_the_panel_s_radiance(version, band):
    row = next(row for row in version["coefficients"] if row["band"] == band)
    assert (row["unit"], version["configuration"]["sunshine_sensor"]["serial"]) == ("sr", "DL03-1706120-SC")
    (point,) = (point for point in version["points"] if point["band"] == band)
    assert point["i_ss_oriented"] == pytest.approx(DLS[band], abs=1e-6)
    # it leaned 11 degrees towards the sun, of which blue has less
    assert point["i_ss"] == pytest.approx(LEVEL[band] * DLS[band], rel=2e-3)
    assert row["value"] == pytest.approx(ALBEDO[band] * point["i_ss"] / RADIANCE[band], rel=1e-3)
    assert {"sunshine_scale_assumed", "sunshine_single_reading"} <= set(row["flags"])
    # by the light sensor +18 and -23 %, elsewhere at most 9 %
    assert ("light_routes_differ" in row["flags"]) is (band in {"blue", "nir"})
    # I_ss / E of the published irradiance on the panel, E = pi L / albedo
    assert row["value"] == pytest.approx(math.pi * point["i_ss"] / IRRADIANCE[band], rel=1e-3)
    assert point["panel_irradiance_w_m2_nm"] == pytest.approx(IRRADIANCE[band], rel=1e-3)
    assert 0.7 < point["i_ss"] / point["panel_irradiance_w_m2_nm"] < 1.5  # one unit, not a hundredth of it


def test_the_panel_measures_itself(sqlite_house, frames, version):
    found = measure(sqlite_house, frames["panel", "red"], version)
    assert found["region_origin"] == "frame"
    assert found["mean"]["value"] == pytest.approx(ALBEDO["red"], rel=1e-9)
    assert found["mean"]["standard_uncertainty"] > 0.005
    assert found["reflected"]["i_ss_basis"] == "levelled"
    # one reading at the panel, one at the frame, and nothing that shows their noise
    assert 2.0 < found["effective_dof"] < 30.0
    assert found["expanded_uncertainty"] == found["coverage_factor"] * found["mean"]["standard_uncertainty"]


def test_an_index_of_bands_without_relatives_is_aligned_by_their_edges(sqlite_house, frames, version):
    """This firmware wrote no RigRelatives, and the bands lie some pixels apart."""
    formula = "1.16 * (nir - red) / (nir + red + 0.16)"
    found = measure(sqlite_house, frames["field", "red"], version, index=formula, products=["bands"])
    (alignment,) = found["alignment"]
    assert (alignment["band"], alignment["by"]) == ("red", "correlation")
    assert alignment["patches"] > 100
    assert 0.05 < alignment["residual_px"] < 0.45
    assert found["expanded_uncertainty"] > 1.96 * found["mean"]["standard_uncertainty"]
    assert found["index"] == {"name": formula, "formula": formula, "bands": found["index"]["bands"]}
    assert {share["source"] for share in found["budget"]} >= {"panel", "K", "alignment", "pixel noise"}
    assert sum(share["variance_share"] for share in found["budget"]) == pytest.approx(1.0)
    (index, u, nir, red), said, tags = read_map(sqlite_house, found)
    metadata = ET.fromstring(tags["GDAL_METADATA"])
    named = [item.text for item in metadata if item.get("role") == "description"]
    assert named == [formula, f"u({formula})", "NIR", "Red"]
    assert [item.text for item in metadata if item.get("name") == "wavelength_nm" and item.get("sample")] == [
        "840.0",
        "668.0",
    ]
    assert said["formula"] == formula
    assert said["calibration"]["id"] == version["id"]
    assert set(said["frames"]) == {"nir", "red"}
    known = np.isfinite(index)
    assert known.mean() > 0.9
    expected = 1.16 * (nir - red) / (nir + red + 0.16)
    np.testing.assert_allclose(index[known], expected[known], rtol=2e-3, atol=2e-3)
    # a pixel has its noise and its edge beside what the whole frame shares
    of_mean = found["mean"]["standard_uncertainty"]
    assert of_mean < float(np.nanmedian(u)) < 2.5 * of_mean
    # an edge that is displaced by a third of a pixel is less certain than a field's middle
    assert np.nanpercentile(u, 99) > 1.2 * np.nanmedian(u)


def test_radiance_is_the_file_s_own_and_knows_no_uncertainty_but_noise(sqlite_house, frames, version):
    found = measure(sqlite_house, frames["panel", "red"], version, quantity="radiance", products=["map"])
    assert (found["radiance"], found["mean"]["unit"]) == ("red", "W/(m2*sr*nm)")
    assert found["mean"]["value"] == pytest.approx(RADIANCE["red"], rel=1e-3)
    assert "radiance_uncertainty_unknown" in [flag["flag"] for flag in found["flags"]]
    plane, said, _ = read_map(sqlite_house, found)
    assert (said["quantity"], said["unit"]) == ("radiance", "W/(m2*sr*nm)")
    assert float(np.nanmax(plane)) < 1.0


@pytest.mark.parametrize(
    ("asked", "code", "match"),
    [
        ({"index": "nir / blu"}, "formula_invalid", "no band blu here, but blue, green, nir, red, red_edge"),
        ({"index": "open('x')"}, "formula_invalid", "contains"),
        ({"index": "ndvi", "quantity": "radiance"}, "option_not_of_method", "leave quantity out"),
    ],
)
def test_what_is_no_index_is_refused_before_the_job(sqlite_house, frames, version, asked, code, match):
    body = {"frame_id": frames["field", "red"]["id"], "calibration_id": version["id"]}
    problem = sqlite_house.post("/v1/measurements", body | asked, status=422)
    assert (problem["code"], match in problem["detail"]) == (code, True)


def test_a_map_s_job_says_how_far_it_is(sqlite_house, frames, version, monkeypatch):
    shares, report = [], sqlite_house.worker.leases.report

    def listen(claim, share):
        shares.append(share)
        report(claim, share)

    monkeypatch.setattr(sqlite_house.worker.leases, "report", listen)
    measure(sqlite_house, frames["field", "red"], version, products=["map"])
    assert len(shares) >= 5
    assert shares == sorted(shares)
    assert (shares[0], shares[-1]) == (0.0, 0.99)  # the last hundredth is its storing


def test_a_flight_frame_is_measured_whole_and_its_map_agrees(sqlite_house, frames, version):
    found = measure(sqlite_house, frames["field", "nir"], version, products=["map"])
    assert (found["region_origin"], found["pixels"]) == ("whole_frame", 1280 * 960)
    plane, said, tags = read_map(sqlite_house, found)
    packet, gps = tags["XMP"], tags["GPSTag"]
    assert (said["band"], said["wavelength_nm"], said["capture_id"]) == (
        "NIR",
        840.0,
        frames["field", "nir"]["capture_id"],
    )
    assert found["map"] == {
        "pixels": plane.size,
        "below_zero": int((plane < 0).sum()),
        "above_one": int((plane > 1).sum()),
        "saturated": int(np.isnan(plane).sum()),
    }
    assert b' Camera:BandName="NIR"' in packet
    assert b"Vignetting" not in packet
    for angle in (b'Camera:IrradianceYaw="-21.1108', b"DLS:Pitch>-0.00964", b"DLS:Roll>-0.02679"):
        assert angle in packet
    assert (gps["GPSLatitudeRef"], gps["GPSLongitudeRef"]) == ("N", "W")
    assert 0.8 < np.nanmax(plane) < 1.0  # 1.15 times as much, had the panel's light not been levelled
    assert found["map"]["saturated"] == round(found["saturated_share"] * plane.size) == 207
    # the region's mean counts saturated pixels as they stand, the map leaves them out
    assert float(np.nanmean(plane, dtype=float)) == pytest.approx(found["mean"]["value"], rel=1e-3)
