"""Measuring over HTTP: a known luminance comes back, with what it was measured with and what to know."""

import csv
import io
import json
from functools import partial

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from PIL import Image

from radiometry.drawing.text import in_step
from service.documents.rendered import write_order
from service.documents.rendering import typeset
from service.documents.report import tabulate_cells, tabulate_flags
from store.tables import FrameRow
from tests.support.blobs import zero
from tests.support.campaigns import K_TRUE, ROI, calibrate, calibrated_campaign, published_campaign
from tests.support.certificates import read_pages
from tests.support.frames import forget_time, place_frame, write_frame
from tests.support.measuring import read_map
from tests.support.resumable import PIECE, begin_upload

pytestmark = pytest.mark.either_database

SETTINGS = {"exposure_time_s": 0.02, "f_number": 4.0, "iso": 3200}
PER_DN = 4.0**2 / (K_TRUE * 0.02 * 3200)
CORNERS = [[8, 8], [88, 8], [88, 56], [8, 56]]
ROAD = np.array([[1.2, 0.9, 0.8, 0.9, 1.1], [1.0, 0.8, 0.6, 0.7, 1.0], [0.7, 0.5, 0.45, 0.5, 0.65]]) * 15


@pytest.fixture
def version(staged):
    """A published calibration of K = 2."""
    return staged(published_campaign, isos=(3200,))


def field_campaign(house, roi=ROI):
    campaign = house.campaign()
    if roi:
        house.put(f"/v1/campaigns/{campaign['id']}/roi", roi)
    return campaign


def field_frame(house, campaign, luminance=20.0, *, name="field.DNG", change=None, **settings):
    content = house.frame_bytes(**({"signal_dn": luminance / PER_DN} | SETTINGS | settings))
    content = change(content) if change else content
    frame = house.upload(campaign, content, role="field", filename=name)
    house.work()
    return frame


def measure(house, frame, **asked):
    return house.measure(frame_id=frame["id"], **asked)


def flags(measurement):
    return {raised["flag"] for raised in measurement["flags"]}


def test_a_frame_of_known_luminance_comes_back_within_its_uncertainty(house, version):
    """Another campaign of the same camera, the version in force when the frame was taken."""
    answer = house.http.post(
        "/v1/measurements", json={"frame_id": field_frame(house, field_campaign(house))["id"]}
    )
    job = answer.json()
    assert (job["kind"], answer.headers["Location"]) == ("measure", f"/v1/jobs/{job['id']}")
    house.work()
    done = house.get(f"/v1/jobs/{job['id']}")
    found = house.get(f"/v1/measurements/{done['result']['measurement_id']}")
    mean = found["mean"]
    assert abs(mean["value"] - 20.0) <= 2 * mean["standard_uncertainty"]
    assert mean["unit"] == "cd/m2"
    used = found["calibration"]
    assert (used["id"], used["version"], used["state"]) == (version["id"], 1, "published")
    assert "version 1 is in force from 2026-05-01T00:00:00Z on" in used["why"]
    assert used["why"].endswith(": first")
    k = next(c for c in version["coefficients"] if (c["iso"], c.get("f_number")) == (3200, 4.0))
    shares = {row["source"]: row for row in found["budget"]}
    assert sum(row["variance_share"] for row in found["budget"]) == pytest.approx(1.0)
    by_k = np.hypot(*(shares[s]["standard_uncertainty_cd_m2"] for s in ("fit of K", "meter calibration")))
    # of K's uncertainty the parts of f-number and time meet the frame's own
    assert 0.0 < by_k < mean["value"] * k["standard_uncertainty"] / k["value"]
    assert (found["region_origin"], found["vignetting"]) == ("campaign", "none")
    assert (found["seen_from"], "0.266" in found["seen_from_detail"]) == ("above", True)
    assert {"no_vignetting_correction", "observer_differs"} <= flags(found)
    # the readings of its calibration name no meter
    assert found["uncertainty_scope"] == "relative_only"
    (raised,) = (each for each in found["flags"] if each["flag"] == "meter_certificate_missing")
    assert "With a meter certificate of U = 3% (k = 2) it would be" in raised["detail"]
    assert any("flat fields" in sentence for sentence in found["to_do_better"])
    assert found["min"]["value"] < found["percentiles"][0]["luminance"]["value"] < found["median"]["value"]
    single = found["min"]["standard_uncertainty"]
    assert single > np.hypot(found["shared_u_cd_m2"] * 0.9, 3.5 * PER_DN)
    assert "null" not in json.dumps(found)


@pytest.mark.usefixtures("version")
def test_a_lit_surface(house):
    samples = np.full((64, 96), 0.0)
    samples[8:56, 8:88] = np.kron(ROAD, np.ones((16, 16))) / PER_DN
    path = write_frame(house.folder / "road.dng", signal_dn=samples, noise_dn=2.0, **SETTINGS)
    frame = house.upload(field_campaign(house), path.read_bytes(), role="field", filename="road.DNG")
    house.work()
    grid = {"corners": CORNERS, "rows": 3, "columns": 5, "corner_u_px": 0.01}
    found = measure(house, frame, grid=grid, reflectance=0.25, mains_frequency_hz=50)
    k = np.mean(ROAD) / found["l_av_cd_m2"]["value"]
    cells = np.array([[cell["value"] for cell in line] for line in found["grid"]["cells"]])
    assert cells * k == pytest.approx(ROAD, rel=0.01)
    assert found["u_o"]["value"] == pytest.approx(0.57203, abs=3 * found["u_o"]["standard_uncertainty"])
    assert found["max_to_min"]["value"] == pytest.approx(
        2.6667, abs=3 * found["max_to_min"]["standard_uncertainty"]
    )
    assert [line["value"] for line in found["u_l"]] == pytest.approx([2 / 3, 0.6, 0.45 / 0.7], rel=0.01)
    # K is the same in every cell: it is the whole of the average's uncertainty and nothing of U_o's
    relative = found["l_av_cd_m2"]["standard_uncertainty"] / found["l_av_cd_m2"]["value"]
    assert found["u_o"]["standard_uncertainty"] / found["u_o"]["value"] < relative / 5
    assert found["grid"]["cell_model"] == "projective"
    assert found["illuminance"]["value"] == pytest.approx(np.pi * found["mean"]["value"] / 0.25)
    assert found["grid_illuminance"]["unit"] == "lx"
    assert {"diffuse_assumed"} == flags(found) & {"diffuse_assumed", "mixed_surface", "grid_mirrored"}
    lanes = {"corners": CORNERS, "lanes": 1, "lane_width_m": 3.5, "spacing_m": 24, "length_m": 48}
    assert house.post("/v1/measurements", {"frame_id": frame["id"], "grid": lanes | {"rows": 3}}, status=422)
    foreseen = house.post(f"/v1/frames/{frame['id']}/grid", lanes, status=200)
    whole = measure(house, frame, grid=lanes)
    assert foreseen["point_u_m"] == whole["grid"]["lanes"]["point_u_m"]
    # 48 m by 3.5 m are longer than 80 px by 48 px can be
    assert [each["flag"] for each in foreseen["flags"]] == ["corners_implausible"]
    assert "corners_implausible" in flags(whole)
    field = whole["grid"]
    path = f"/v1/measurements/{whole['id']}/cells"
    rows = list(csv.DictReader(io.StringIO(house.http.get(f"{path}.csv").text)))
    assert (len(rows), rows[11]["row"], rows[11]["column"]) == (30, "2", "2")
    assert [float(rows[11][name]) for name in ("x_m", "y_m", "x_px", "y_px")] == pytest.approx(
        [3.6, 1.75, 14, 32]
    )
    assert float(rows[11]["luminance_cd_m2"]) == field["cells"][1][1]["value"]
    road, pixel = house.get(f"{path}.geojson"), house.get(f"{path}.geojson", coordinates="pixel")
    ends = [
        (each["coordinates_in"], each["features"][0]["geometry"]["coordinates"][0][2])
        for each in (road, pixel)
    ]
    assert [name for name, _ in ends] == ["road_m", "pixel"]
    assert {(each["type"], each["geometry"]["type"]) for each in road["features"]} == {("Feature", "Polygon")}
    assert np.array([corner for _, corner in ends]) == pytest.approx(np.array([[2.4, 3.5 / 3], [12, 24]]))
    assert house.get(f"/v1/measurements/{found['id']}/cells.geojson")["coordinates_in"] == "pixel"
    check_report(house, measure(house, frame, grid=grid, products=["map"]))
    bare = read_words(house.http.get(f"/v1/measurements/{whole['id']}/report.pdf").content)
    assert (len(bare), "Measured without a map" in bare[0]) == (2, True)
    # half of the rectangle, which is not seen in perspective
    assert (field["rows"], field["columns"]) == (3, 10)
    assert np.array(field["corners"]) == pytest.approx(np.array([[8, 8], [48, 8], [48, 56], [8, 56]]))
    assert (field["lanes"]["along_m"], field["lanes"]["points_m"][0][1][0]) == pytest.approx((2.4, 3.6))
    assert field["cells"][0][0]["value"] * k == pytest.approx(ROAD[0][0], rel=0.02)


def check_report(house, found):
    """Two pages, whatever is on them: with every figure, and with many flags and cells."""
    path = f"/v1/measurements/{found['id']}/report.pdf"
    with pytest.MonkeyPatch.context() as patch:
        laid = []
        patch.setattr(
            "service.documents.report.write_order",
            lambda kind, sheets: laid.append(sheets) or write_order(kind, sheets=sheets),
        )
        answer = house.http.get(path)
    assert (answer.status_code, answer.headers["Content-Type"]) == (200, "application/pdf")
    first, second = read_words(answer.content)
    u_o = " ".join(in_step(found["u_o"]["value"], found["u_o"]["standard_uncertainty"]))
    for said in (f"Overall uniformity U_o {u_o}", "road.DNG", "Seen from above", "0.266"):
        assert said in first
    for said in ("meter calibration", found["content_sha256"], "from 2026-05-01", "first"):
        assert said in second
    assert laid[0]["picture"]["svg"].count("<polygon") == 16
    cell = found["grid"]["cells"][0][0]
    for rows, columns in ((14, 6), (40, 30)):
        grid = found["grid"] | {"rows": rows, "columns": columns, "cells": [[cell] * columns] * rows}
        cells = tabulate_cells(grid)
        flags = tabulate_flags([{"flag": "roi_elsewhere", "where": "", "detail": "long " * 60}] * 8)
        assert len(read_pages(typeset(laid[0] | {"cells": cells, "flags": flags}))) == 2
    assert "16 of 40 rows and 16 of 30 columns" in cells["caption"]


def read_words(pdf):
    return [" ".join(page.split()) for page in read_pages(pdf)]


@pytest.mark.usefixtures("version")
def test_the_headline_is_of_the_drawn_surface(house):
    """The request's region, else its grid's outline, else the frame's, else the campaign's."""
    samples = np.full((64, 96), 10.0 / PER_DN)
    samples[:, 48:] *= 2.0
    path = write_frame(house.folder / "sides.dng", signal_dn=samples, noise_dn=2.0, **SETTINGS)
    campaign = field_campaign(house, roi=left(4))
    frame = house.upload(campaign, path.read_bytes(), role="field", filename="sides.DNG")
    house.work()
    right = {"corners": [[56, 8], [88, 8], [88, 56], [56, 56]], "rows": 1, "columns": 2}
    ends = []
    for asked in ({}, {"grid": right}, {"grid": right, "roi": left(20)}):
        found = measure(house, frame, **asked, reflectance=0.2)
        ends.append((found["region_origin"], round(found["mean"]["value"])))
        assert found["median"]["value"] == pytest.approx(found["mean"]["value"], rel=0.01)
        assert found["illuminance"]["value"] == pytest.approx(np.pi * found["mean"]["value"] / 0.2)
    assert ends == [("campaign", 10), ("grid", 20), ("request", 10)]
    assert found["l_av_cd_m2"]["value"] == pytest.approx(20.0, rel=0.03)
    house.put(f"/v1/frames/{frame['id']}/roi", left(30))
    house.work()
    own = measure(house, frame)
    assert (own["region_origin"], own["region"]) == (
        "frame",
        [list(map(float, xy)) for xy in left(30)["polygon"]],
    )
    assert measure(house, frame, grid=right)["region"] == right["corners"]


@pytest.mark.usefixtures("version")
def test_the_light_of_a_campaign_counts_unless_the_request_states_another(house):
    campaign = field_campaign(house)
    light = {"lamp_kind": "led", "mains_frequency_hz": 60.0}
    assert light.items() <= house.patch(f"/v1/campaigns/{campaign['id']}", light).items()
    frame = field_frame(house, campaign)

    def flicker(**asked):
        found = measure(house, frame, **asked)
        (line,) = (each for each in found["corrections"] if each["source"] == "flicker")
        return found, line

    found, line = flicker()
    assert found["conditions_origin"] == {"lamp_kind": "campaign", "mains_frequency_hz": "campaign"}
    assert (line["values"]["lamp_kind"], line["values"]["modulation"]) == ("led", [0.0, 0.1])
    assert "flicker_unknown" not in flags(found)
    # another lamp is another light: its supply is not known from the campaign's
    other, line = flicker(lamp_kind="sodium")
    assert other["conditions_origin"] == {"lamp_kind": "request"}
    assert line["values"]["mains_frequency_hz"] == [50.0, 60.0]
    assert any("`lamp_kind`" in sentence for sentence in other["to_do_better"])
    # the supply alone changes the line
    own, line = flicker(mains_frequency_hz=47, lamp_modulation=0.3)
    assert own["conditions_origin"]["lamp_modulation"] == "request"
    assert (line["values"]["mains_frequency_hz"], line["values"]["modulation"]) == (47.0, [0.3, 0.3])
    direct = measure(house, frame, mains_frequency_hz=0)
    assert "flicker" not in {each["source"] for each in direct["corrections"]}
    assert house.post("/v1/measurements", {"frame_id": frame["id"], "lamp_kind": "candle"}, status=422)


def left(side):
    return {"polygon": [[4, 8], [4 + side, 8], [4 + side, 56], [4, 56]]}


def test_a_map_holds_every_pixel_and_names_what_made_it(house, version):
    frame = field_frame(house, field_campaign(house))
    with house.database.writing("test") as session:
        row = session.get_one(FrameRow, frame["id"])
        row.header = {**row.header, "attitude": [{"name": "drone-dji:GimbalPitchDegree", "value": -89.9}]}
    found = measure(house, frame, products=["map"])
    links = found["links"]
    answer = house.http.get(links["map_tif"])
    assert (answer.headers["Content-Type"], "immutable" in answer.headers["Cache-Control"]) == (
        "image/tiff",
        True,
    )
    assert answer.headers["Content-Disposition"].endswith(f"''field-{found['id']}.tif")
    again = house.http.get(links["map_tif"], headers={"If-None-Match": answer.headers["ETag"]})
    assert (again.status_code, again.content) == (304, b"")
    values, told, tags = read_map(house, found)
    assert (values.shape, values.dtype) == ((64, 96), np.float32)
    assert told["unit"] == "cd/m2"
    assert b' drone-dji:GimbalPitchDegree="-89.9"' in tags["XMP"]
    assert told["calibration"] == {
        "id": version["id"],
        "version": 1,
        "content_sha256": version["content_sha256"],
    }
    greens = np.zeros((64, 96), bool)
    greens[0::2, 1::2] = greens[1::2, 0::2] = True
    greens[:8] = greens[56:] = False
    greens[:, :8] = greens[:, 88:] = False
    # its pixels are rounded to 12 bits
    assert values[greens].mean() == pytest.approx(found["mean"]["value"], rel=told["rounding_rel"])
    assert values[greens].min() == pytest.approx(found["min"]["value"], rel=told["rounding_rel"])
    picture = house.http.get(links["map_png"])
    assert picture.headers["Content-Type"] == "image/png"
    with Image.open(io.BytesIO(picture.content)) as image:
        assert image.width <= 1600


@pytest.mark.usefixtures("version")
def test_a_map_that_is_not_there_or_lost_is_made_by_measuring_again(house):
    frame = field_frame(house, field_campaign(house))
    bare = measure(house, frame)
    assert "map_tif" not in bare["links"]
    problem = house.get(f"/v1/measurements/{bare['id']}/map.tif", status=404)
    assert '"products": ["map"]' in problem["detail"]
    found = measure(house, frame, products=["map"])
    address = found["links"]["map_tif"]
    before = house.http.get(address)
    sha256 = before.headers["ETag"].strip('"')
    zero(house.folder, sha256, first=500, count=900)
    for lost in (address, f"/v1/measurements/{found['id']}/map.json"):
        assert house.get(lost, status=500)["code"] == "stored_file_damaged"
    assert measure(house, frame, products=["map"])["id"] == found["id"]
    assert house.http.get(address).content == before.content


def test_the_same_request_again_is_the_same_measurement(house, version):
    campaign = field_campaign(house)
    frame = field_frame(house, campaign)
    first, again = (measure(house, frame, products=["map"]) for _ in range(2))
    other = measure(house, frame, products=["map"], reflectance=0.5)
    assert first["id"] == again["id"] != other["id"]
    assert first["content_sha256"] != other["content_sha256"]
    for name, value in (
        ("camera_id", version["camera_id"]),
        ("campaign_id", campaign["id"]),
        ("calibration_id", version["id"]),
    ):
        listed = house.get("/v1/measurements", **{name: value})["items"]
        assert [row["id"] for row in listed] == [other["id"], first["id"]]
        assert house.get("/v1/measurements", **{name: "nothing"})["items"] == []


def test_an_iso_that_was_not_calibrated_and_a_frame_of_another_camera_are_refused(house, version):
    frame = field_frame(house, field_campaign(house), iso=100)
    problem = house.post("/v1/measurements", {"frame_id": frame["id"]}, status=422)
    assert problem["code"] == "iso_not_calibrated"
    assert "ISO 100; this calibration holds ISO 3200" in problem["detail"]
    other = house.post("/v1/cameras", {"make": "DJI", "model": "FC6520", "serial": "OTHER"})
    campaign = house.post("/v1/campaigns", {"camera_id": other["id"], "method": "luminance"})
    frame = field_frame(house, campaign, serial="OTHER")
    asked = {"frame_id": frame["id"], "calibration_id": version["id"], "roi": ROI}
    assert house.post("/v1/measurements", asked, status=422)["code"] == "wrong_camera"
    assert house.get("/v1/jobs", kind="measure")["items"] == []


def test_without_a_version_in_force_nothing_is_measured_in_silence(house, staged):
    made = staged(calibrated_campaign, isos=(3200,))
    frame = field_frame(house, field_campaign(house))
    problem = house.post("/v1/measurements", {"frame_id": frame["id"]}, status=409)
    assert problem["code"] == "no_calibration_in_force"
    assert "calibration_id" in problem["detail"]
    draft = measure(house, frame, calibration_id=made["id"])
    assert "calibration_not_published" in flags(draft)
    house.publish(made, valid_to="2026-05-01T20:00:00Z")  # the frame's very instant is not within
    house.post("/v1/measurements", {"frame_id": frame["id"]}, status=409)
    found = measure(house, frame, calibration_id=made["id"])
    assert found["calibration"]["why"] == "version 1 was named in the request"


def test_what_becomes_of_the_version_is_told_with_every_measurement(house, version):
    frame = field_frame(house, field_campaign(house))
    found = measure(house, frame)
    address = f"/v1/measurements/{found['id']}"
    tag = house.http.get(address).headers["ETag"]
    assert house.http.get(address, headers={"If-None-Match": tag}).status_code == 304
    newer = calibrate(house, {"id": version["campaign_id"]}, model="affine")
    house.publish(newer)
    now = house.get(address)
    (superseded,) = (each for each in now["flags"] if each["flag"] == "calibration_superseded")
    assert superseded["detail"] == f"By version {newer['version']}."
    assert now["calibration"]["superseded_by"] == newer["id"]
    assert now["mean"] == found["mean"]
    assert house.http.get(address, headers={"If-None-Match": tag}).status_code == 200
    house.revoke(version, "lamp was warm")
    now = house.get(address)
    assert "calibration_revoked" in flags(now)
    assert now["calibration"]["revoked_reason"] == "lamp was warm"
    asked = {"frame_id": frame["id"], "calibration_id": version["id"]}
    assert house.post("/v1/measurements", asked, status=409)["code"] == "calibration_revoked"


def test_a_map_or_glare_of_a_model_that_is_no_scale_is_refused_at_once(house, version):
    power = calibrate(house, {"id": version["campaign_id"]}, model="power")
    frame = field_frame(house, field_campaign(house))
    asked = {"frame_id": frame["id"], "calibration_id": power["id"]}
    for more in ({"products": ["map"]}, {"glare_share": 0.02}):
        assert "proportional" in house.post("/v1/measurements", asked | more, status=422)["detail"]
    assert measure(house, frame, calibration_id=power["id"])["mean"]["value"] == pytest.approx(20.0, rel=0.05)


@pytest.mark.usefixtures("version")
def test_what_must_be_there_before_measuring(house):
    campaign = field_campaign(house, roi=None)
    unread = house.upload(campaign, house.frame_bytes(seed=5, **SETTINGS), role="field", filename="u.DNG")
    asked = {"frame_id": unread["id"]}
    assert house.post("/v1/measurements", asked, status=422)["code"] == "frame_not_read"
    house.work()
    assert house.post("/v1/measurements", asked, status=422)["code"] == "region_missing"
    outside = {"polygon": [[0, 0], [200, 0], [200, 60]]}
    assert house.post("/v1/measurements", asked | {"roi": outside}, status=422)["code"] == "roi_outside_frame"
    line = {"corners": [[0, 0], [10, 0], [20, 0], [0, 9]], "rows": 1, "columns": 1}
    assert house.post("/v1/measurements", asked | {"grid": line}, status=422)["code"] == "grid_invalid"
    grid = {"corners": CORNERS, "rows": 1, "columns": 1}
    assert measure(house, unread, grid=grid)["region_origin"] == "grid"
    assert measure(house, unread, roi=ROI)["region_origin"] == "request"


def test_a_frame_without_a_time_needs_a_named_version(house, version):
    frame = field_frame(house, field_campaign(house), change=forget_time)
    problem = house.post("/v1/measurements", {"frame_id": frame["id"]}, status=422)
    assert problem["code"] == "frame_time_missing"
    assert "calibration_id" in problem["detail"]
    assert measure(house, frame, calibration_id=version["id"])["calibration"]["id"] == version["id"]


@pytest.mark.parametrize(("start", "status"), [("2026-05-01T05:59:00Z", 202), ("2026-05-01T06:01:00Z", 409)])
def test_a_time_without_a_zone_must_be_covered_wherever_it_was(house, staged, start, status):
    """20:00 on 1 May somewhere: from 06:00 to 08:00 of the next day in UTC."""
    made = staged(calibrated_campaign, isos=(3200,))
    house.publish(made, valid_from=start)
    frame = field_frame(house, field_campaign(house), change=partial(forget_time, zone_only=True))
    house.post("/v1/measurements", {"frame_id": frame["id"]}, status=status)


@pytest.mark.usefixtures("version")
def test_a_whole_night_in_one_go(house):
    campaign = field_campaign(house)
    assert house.post(f"/v1/campaigns/{campaign['id']}/measurements", {}, status=422)

    def place(content):
        return place_frame(content, latitude_deg=-33.5, longitude_deg=-70.25, altitude_m=512.5)

    frames = [
        field_frame(house, campaign, 20.0, name="a.DNG", change=place),
        field_frame(house, campaign, 10.0, name="b.DNG", seed=2),
        field_frame(house, campaign, 10.0, name="c.DNG", seed=3, iso=100),
    ]
    house.upload(campaign, house.frame_bytes(seed=9), role="light", scene="x", filename="light.DNG")
    # a region of its own for one frame, that of the campaign for the others
    corners = [[4.0, 8.0], [34.0, 8.0], [34.0, 56.0], [4.0, 56.0]]
    house.put(f"/v1/frames/{frames[1]['id']}/roi", {"polygon": corners})
    house.work()
    started = house.post(f"/v1/campaigns/{campaign['id']}/measurements", {"reflectance": 0.1}, status=202)
    assert [job["subject_id"] for job in started["jobs"]] == [frame["id"] for frame in frames[:2]]
    (left,) = started["not_measured"]
    assert (left["frame_id"], left["code"]) == (frames[2]["id"], "iso_not_calibrated")
    house.work()
    answer = house.http.get(f"/v1/series/measurements?campaign_id={campaign['id']}&format=csv")
    rows = list(csv.DictReader(io.StringIO(answer.text)))
    assert [row["filename"] for row in rows] == ["a.DNG", "b.DNG"]
    assert float(rows[0]["mean_cd_m2"]) == pytest.approx(20.0, rel=0.03)
    assert float(rows[0]["latitude_deg"]) == pytest.approx(-33.5)
    assert rows[1]["latitude_deg"] == ""
    assert float(rows[1]["illuminance_lx"]) == pytest.approx(np.pi * float(rows[1]["mean_cd_m2"]) / 0.1)
    answer = house.http.get(f"/v1/campaigns/{campaign['id']}/measurements.geojson")
    assert answer.headers["Content-Type"] == "application/geo+json"
    first, second = answer.json()["features"]
    assert first["geometry"] == {"type": "Point", "coordinates": [-70.25, -33.5, 512.5]}
    assert second["geometry"] is None
    assert second["properties"]["calibration_version"] == 1
    asked = {each["id"]: house.get(f"/v1/measurements/{each['id']}") for each in (first, second)}
    assert [each["region_origin"] for each in asked.values()] == ["campaign", "frame"]
    assert asked[second["id"]]["region"] == corners
    document = house.get("/openapi.json")
    media = document["paths"]["/v1/campaigns/{campaign_id}/measurements.geojson"]["get"]["responses"]["200"]
    schema = media["content"]["application/geo+json"]["schema"] | {"components": document["components"]}
    Draft202012Validator(schema).validate(answer.json())
    row = document["components"]["schemas"]["MeasurementRow"]["properties"]
    assert row["mean_cd_m2"]["type"] == "number"
    assert {*first["properties"]} <= {*row}
    none = house.http.get(
        f"/v1/campaigns/{campaign['id']}/measurements.geojson", params={"calibration_id": "other"}
    )
    assert none.json() == {"type": "FeatureCollection", "features": []}


@pytest.mark.usefixtures("version")
def test_night_of_measurements_feeds_no_fit(house):
    camera = house.camera()["id"]
    body = {"camera_id": camera, "method": "vignetting", "kind": "measurement"}
    assert "luminance" in house.post("/v1/campaigns", body, status=422)["errors"][0]["message"]
    night = house.campaign(kind="measurement")
    path = f"/v1/campaigns/{night['id']}"
    assert house.get(path)["missing"] == ["no frame: send the frames of the night"]
    refused = house.upload(night, house.frame_bytes(), role="light", scene="a", status=409)
    assert refused["code"] == "measurements_only"
    frame = field_frame(house, night)
    frames = {"frame_ids": [frame["id"]], "role": "light"}
    for answer in (
        house.http.patch(f"/v1/frames/{frame['id']}", json={"role": "dark"}),
        house.http.patch(f"{path}/frames", json=frames),
        house.http.post(f"{path}/calibrations", json={}),
    ):
        assert (answer.status_code, answer.json()["code"]) == (409, "measurements_only")
    assert "night of measurements has none" in house.get(f"{path}/checklist")["said"]
    measure(house, frame, roi=ROI)
    whole = house.get(path)
    assert (whole["kind"], whole["missing"], whole["measured"]) == ("measurement", [], 1)
    # an older campaign that holds nothing but field frames becomes one
    other = house.campaign(project_number="older")
    field_frame(house, other)
    late = house.frame_bytes(seed=77)
    place = begin_upload(house, other["id"], late, scene="a")
    changed = house.patch(f"/v1/campaigns/{other['id']}", {"kind": "measurement"})
    assert changed["kind"] == "measurement"
    # an upload that began before
    refused = house.http.patch(place, content=late, headers=PIECE | {"Upload-Offset": "0"})
    assert (refused.status_code, refused.json()["code"]) == (409, "measurements_only")
    assert {each["role"] for each in house.get(f"/v1/campaigns/{other['id']}/frames")["items"]} == {"field"}
    third = house.campaign(project_number="third")
    house.upload(third, house.frame_bytes(), role="dark", filename="d.DNG")
    refused = house.patch(f"/v1/campaigns/{third['id']}", {"kind": "measurement"}, status=409)
    assert "d.DNG" in refused["detail"]
    kept = house.get("/v1/campaigns", kind="measurement")["items"]
    assert {each["id"] for each in kept} == {night["id"], other["id"]}


@pytest.mark.usefixtures("version")
def test_repeats_of_a_scene_are_one_measurement_with_less_noise(house):
    campaign = field_campaign(house)
    frames = [field_frame(house, campaign, name=f"{seed}.DNG", seed=seed, noise_dn=8.0) for seed in range(4)]
    ids = sorted(frame["id"] for frame in frames)
    alone = [measure(house, frame, products=["map"]) for frame in frames]
    found = average(house, ids, products=["map"])
    assert found["frame_ids"] == ids
    assert found["frame_id"] == ids[0]
    assert "frame_ids" not in alone[0]
    assert found["mean"]["value"] == pytest.approx(np.mean([one["mean"]["value"] for one in alone]), rel=1e-9)
    assert found["noise_u_cd_m2"] == pytest.approx(alone[0]["noise_u_cd_m2"] / 2, rel=0.1)
    sources = [row["source"] for row in found["budget"]]
    assert "scatter between repeats" in sources
    plane, *planes = (read_map(house, one)[0] for one in (found, *alone))
    assert plane == pytest.approx(np.mean(planes, axis=0), rel=1e-6)
    assert average(house, ids[::-1], products=["map"])["id"] == found["id"]
    rows = house.http.get(f"/v1/series/measurements?campaign_id={campaign['id']}&format=csv").text
    assert [row["frames"] for row in csv.DictReader(io.StringIO(rows))] == ["1"] * 4 + ["4"]
    longer = field_frame(house, campaign, name="long.DNG", exposure_time_s=0.04)
    for other, told in ((longer["id"], "different: exposure"), (ids[0], "one image")):
        problem = house.post("/v1/measurements", {"frame_ids": [ids[0], other]}, status=422)
        assert (problem["code"], told in problem["detail"]) == ("frames_differ", True)
    for both in ({}, {"frame_id": ids[0], "frame_ids": ids}):
        house.post("/v1/measurements", both, status=422)


def average(house, ids, **asked):
    return house.measure(**({"frame_ids": ids} | asked))
