"""Roads through HTTP and the worker: stated, read, evaluated, exported."""

import csv
import io
import math

import numpy as np
import pytest

from tests.support.certificates import read_pages
from tests.support.frames import place_frame
from tests.support.roads import (
    MARKS,
    METER,
    PX_PER_M,
    REQUIREMENT,
    RULE,
    SITE,
    SPACING_M,
    WIDTH_M,
    evaluate,
    evaluate_road,
    illuminate,
    list_points,
    state_road,
    write_road_frame,
)

pytestmark = pytest.mark.either_database


@pytest.fixture
def road(staged):
    return staged(state_road)


def test_rules_are_dated_and_name_their_source(house):
    rules = {each["name"]: each for each in house.get("/v1/road-rules")["items"]}
    rule = rules[RULE]
    assert rule["date"] == "2015-12-01"
    assert "memory" in rule["read"]
    c3 = next(each for each in rule["classes"] if each["name"] == "C3")
    assert c3["criteria"] == [{"figure": "e_av", "at_least": 15.0}, {"figure": "u_0", "at_least": 0.4}]


def test_a_road_is_answered_as_it_was_stated_with_the_grid_of_its_rule(house, road):
    assert road["site"] == {name: road["site"][name] for name in SITE}
    assert len(road["grid"]) == 10 * 6  # S = 30 m: N = 10; three rows a lane
    assert road["grid"][0] == {"name": "1/1-1", "part": "1", "row": 1, "column": 1, "x_m": 1.5, "y_m": 0.5}
    assert [len(each["marks"]) for each in road["frames"]] == [len(MARKS)] * 2
    assert house.get("/v1/roads")["items"] == [road]
    changed = house.patch(f"/v1/roads/{road['id']}", {"hidden": ["2/3-10"]})
    assert (changed["hidden"], changed["site"]) == (["2/3-10"], road["site"])


def test_a_frame_is_placed_by_marks_before_they_are_stated(house, road):
    path, frame_id = f"/v1/roads/{road['id']}/placement", road["frames"][0]["frame_id"]
    placed = house.post(path, {"frame_id": frame_id, "marks": MARKS}, status=200)
    for mark in MARKS:
        x, y, w = np.array(placed["matrix"]) @ placed["h"] @ (mark["x_m"], mark["y_m"], 1.0)
        assert (x / w + 0.5, y / w + 0.5) == pytest.approx((mark["x_px"], mark["y_px"]), abs=1e-6)
    assert placed["distortion"] == [0.0] * 5
    # 1 px is 1/16 m, and a mark is known to 0.03 m: six of them know a point better than that
    assert 0.1 < placed["place_u_m"] / math.hypot(1 / PX_PER_M, 0.03) < 1.0
    line = [each for each in MARKS if each["y_m"] == 0.0] + [MARKS[1] | {"x_m": 20.0, "y_m": 0.0}]
    refused = house.post(path, {"frame_id": frame_id, "marks": line}, status=422)
    assert refused["code"] == "place_undetermined"
    assert house.get(f"/v1/roads/{road['id']}") == road


def test_control_points_from_a_spreadsheet_are_those_of_json(house, road):
    def put(text):
        return house.http.put(path, content=text, headers={"Content-Type": "text/csv"})

    path = f"/v1/roads/{road['id']}/points"
    sent = house.get(path)["items"]
    out = io.StringIO()
    writer = csv.writer(out, delimiter=";")
    writer.writerow(["name", "x_m", "y_m", "quantity", "unit", "value", "value_2", "meter_id"])
    for point in sent:
        cells = [f"{each:.6f}".replace(".", ",") for each in (point["x_m"], point["y_m"], *point["values"])]
        writer.writerow([point["name"], *cells[:2], "illuminance", "lx", *cells[2:], point["meter_id"]])
    kept = put(out.getvalue()).json()["items"]
    assert [each["values"] for each in kept] == [pytest.approx(each["values"], abs=1e-6) for each in sent]
    assert [each["name"] for each in kept] == [each["name"] for each in sent]
    for columns, cells, said in (
        ("value,value_2", ",25.3", [25.3]),
        ("value_2", "2", "line 1"),
        ("value", "", "line 2.value"),
        ("value,value_2,value_3", "2,,x", "line 2.value_3"),
    ):
        told = put(f"name,x_m,y_m,{columns}\nP1,2,1.5,{cells}").json()
        assert said == (told["errors"][0]["field"] if "errors" in told else told["items"][0]["values"])
    assert {(each["quantity"], each["unit"]) for each in house.get(path)["items"]} == {("illuminance", "lx")}


def test_what_cannot_be_used_is_refused_by_name(house, road):
    def refuse(path, body, method="POST"):
        return house.ask(method, path, status=422, json=body)

    stated = {"name": "x", "site": SITE, "requirement": REQUIREMENT}
    assert refuse("/v1/roads", stated | {"site": SITE | {"strips": []}})["code"] == "site_invalid"
    unknown = stated | {"requirement": REQUIREMENT | {"road_class": "C9"}}
    assert refuse("/v1/roads", unknown)["code"] == "road_rule_unknown"
    assert "body.hidden" in refuse("/v1/roads", stated | {"hidden": ["3/1-1"]})["detail"]
    few = refuse("/v1/roads", stated | {"frames": [{"frame_id": "frm_1", "marks": MARKS[:3]}]})
    assert few["errors"][0]["field"] == "body.frames.0.marks"
    path = f"/v1/roads/{road['id']}/points"
    points = list_points(house.post("/v1/meters", METER, status=200)["id"])
    refuse(path, [points[0], points[0]], "PUT")
    bare = {"name": "P", "x_m": 2, "y_m": 1, "value": 25.3}
    assert "0.unit: is missing" in refuse(path, [bare], "PUT")["detail"]
    refuse(path, [points[0] | {"unit": "cd/m2"}], "PUT")
    assert "meter" in refuse(path, [points[0] | {"quantity": "luminance", "unit": "cd/m2"}], "PUT")["detail"]
    assert "frames" in refuse(f"/v1/roads/{house.post('/v1/roads', stated)['id']}/evaluate", None)["detail"]


ROW, LANE = SITE["rows"][0], SITE["strips"][0]
LANES = [LANE | {"name": str(n)} for n in range(3)]
SQUARE = [[0, 0], [9_000, 0], [9_000, 9_000], [0, 9_000]]


def test_what_no_road_can_be_is_refused_before_it_is_laid(house, road):
    """Each of the first once kept the service busy for ever, or ended in a 500."""
    for stated, named in (
        ({"site": SITE | {"rows": [ROW | {"spacing_m": 1e9}]}}, "body.site.rows.0.spacing_m"),
        ({"site": SITE | {"rows": [ROW | {"height_m": 1e300}]}}, "body.site.rows.0.height_m"),
        ({"site": {"rows": [ROW | {"spacing_m": 1000.0}], "strips": LANES}}, "3006 points"),
        ({"site": SITE | {"rows": [ROW] * 51}}, "1 to 50 rows"),
        ({"site": SITE | {"areas": [{"name": "a", "corners_m": SQUARE}]}}, "36000000 points"),
        ({"site": SITE | {"areas": [{"name": "a", "corners_m": SQUARE[:2]}]}}, "three corners"),
        ({"site": {"rows": [ROW], "strips": [LANE | {"width_m": 0}]}}, "body.site.strips.0.width_m"),
        ({"conditions": {"patches_u_rel": 0}}, "body.conditions.patches_u_rel"),
        ({"requirement": REQUIREMENT | {"criteria": [{"figure": "e_av"}]}}, "needs at_least or at_most"),
        ({"frames": [{"frame_id": "frm_1", "marks": MARKS}] * 2}, "each is stated once"),
        ({"frames": [{"frame_id": "f", "marks": [MARKS[0] | {"u_m": 0}, *MARKS]}]}, "marks.0.u_m"),
    ):
        assert named in house.patch(f"/v1/roads/{road['id']}", stated, status=422)["detail"]
    path = f"/v1/roads/{road['id']}/site.geojson"
    features = house.get(path)
    for kind in (None, "sea", 7):
        features["features"][-1]["properties"]["kind"] = kind
        assert "strips.1.kind" in house.put(path, features, status=422)["detail"]
    refused = house.put(path, features | {"features": [{}]}, status=422)
    assert "LineStrings with `height_m`" in refused["detail"]
    house.get(f"/v1/roads/{road['id']}/results/{10**30}", status=422)


@pytest.fixture
def evaluated(staged):
    return staged(evaluate_road)


def figures(result):
    return {each["figure"]: each for each in result["figures"]}


def test_an_evaluation_finds_the_light_of_the_lamps(house, evaluated):
    """Matt pavement without patches: E on the grid is that of the formula, within the meter's 2 %."""
    truth = np.array([float(illuminate(each["x_m"], each["y_m"])) for each in evaluated["points"]])
    found = np.array([each["illuminance_lx"] for each in evaluated["points"]])
    assert np.abs(found / (truth * 1.005) - 1.0).max() < 3 * 0.025
    known = figures(evaluated)
    assert known["e_av"]["low"] < truth.mean() < known["e_av"]["high"]
    assert known["u_0"]["low"] < truth.min() / truth.mean() < known["u_0"]["high"]
    assert known["e_av"]["expanded_uncertainty"] < 0.08 * truth.mean()
    assert evaluated["verdict"] == "conforms"
    judged = [(each["figure"], each["verdict"]) for each in evaluated["criteria"]]
    assert judged == [("e_av", "conforms"), ("u_0", "conforms")]
    assert {each["state"] for each in evaluated["control"]} == {"agrees"}
    # nobody stated a certificate of the meter behind this K
    assert ("road_meter_uncertified", "K") in {(each["flag"], each["where"]) for each in evaluated["flags"]}
    (used,) = {(each["calibration_state"], each["lens"]) for each in evaluated["frames"]}
    assert used == ("published", "none")
    assert all(each["certificate"] for each in evaluated["frames"])
    jobs = house.get(f"/v1/jobs?subject={evaluated['road_id']}")["items"]
    assert [(each["kind"], each["state"]) for each in jobs] == [("measure", "succeeded")]
    again = evaluate(house, {"id": evaluated["road_id"]})
    assert (again["number"], again["content_sha256"]) == (1, evaluated["content_sha256"])


def test_a_revoked_version_lists_the_roads_that_rest_on_it(house, evaluated):
    (version,) = {each["calibration_id"] for each in evaluated["frames"]}
    cause = {"software": house.get(f"/v1/calibrations/{version}")["software"]["stilb"]}
    recall = house.post("/v1/recalls", {"cause": cause, "reason": "wrong lamp"})
    revoked = house.revoke({"id": version})
    path = f"/v1/roads/{evaluated['road_id']}/results/1"
    (touched,) = revoked["roads"]
    assert (touched["road_id"], touched["number"]) == (evaluated["road_id"], 1)
    assert (touched["name"], touched["verdict"], touched["link"]) == ("Harbour Street", "conforms", path)
    condemned = {
        each["calibration_id"]: each for each in house.get(f"/v1/recalls/{recall['id']}")["versions"]
    }
    assert condemned[version]["roads"] == [touched]
    assert {each["calibration_state"] for each in house.get(path)["frames"]} == {"revoked"}


def test_the_view_follows_from_the_optics_that_are_stated(house, road):
    """From straight above at height h = f_px / 16 px/m, the far corner of the field is atan(d / h) off."""
    frame = house.get(f"/v1/frames/{road['frames'][0]['frame_id']}")
    campaign = house.get(f"/v1/campaigns/{frame['campaign_id']}")
    house.patch(f"/v1/cameras/{campaign['camera_id']}", {"pixel_pitch_um": 5.0})
    house.patch(f"/v1/campaigns/{campaign['id']}", {"focal_length_mm": 8.0})
    height_m = 8.0e3 / 5.0 / PX_PER_M
    far_m = math.hypot(SPACING_M / 2 - 1.5, WIDTH_M / 2 - 0.5)
    view_deg = evaluate(house, road)["grid"]["view_deg"]
    assert view_deg == pytest.approx(math.degrees(math.atan(far_m / height_m)), abs=1.0)


def test_a_frame_without_marks_is_placed_by_its_own_position(house, road):
    """50 m above the middle of the field at 16 px/m: 800 px are 4 mm of 5 um; x runs to the east."""
    origin = {"longitude_deg": 8.5, "latitude_deg": 47.0, "bearing_deg": 90.0, "y_to_the_right": True}
    place = {"latitude_deg": 47.0 - WIDTH_M / 2 / 111_174.0, "longitude_deg": 8.5 + SPACING_M / 2 / 76_056.0}
    dji = {"GimbalYawDegree": "0", "GimbalPitchDegree": "-90", "GimbalRollDegree": "0"}
    night = house.get(f"/v1/frames/{road['frames'][0]['frame_id']}")["campaign_id"]
    content = place_frame(
        write_road_frame(house.folder, seed=7).read_bytes(),
        **place,
        altitude_m=480.0,
        **dji,
        RelativeAltitude="+50.0",
        RtkFlag="50",
        RtkStdLat="0.02",
        RtkStdLon="0.02",
        RtkStdHgt="0.03",
    )
    frame_id = house.upload({"id": night}, content, role="field")["id"]
    house.work()
    path = f"/v1/roads/{road['id']}"

    def refuse(words):
        problem = house.post(f"{path}/evaluate", None, status=422)
        assert (problem["code"], words in problem["detail"]) == ("place_undetermined", True)

    house.patch(path, {"frames": [{"frame_id": frame_id, "height_u_m": 0.2}]})
    refuse("its focal length and pixel pitch are not stated")
    camera = house.get(f"/v1/campaigns/{night}")["camera_id"]
    house.patch(f"/v1/cameras/{camera}", {"pixel_pitch_um": 5.0})
    house.patch(f"/v1/campaigns/{night}", {"focal_length_mm": 4.0})
    refuse("the site has no origin")
    assert house.post(f"{path}/placement", {"frame_id": frame_id}, status=422)["code"] == "place_undetermined"
    (stated,) = house.patch(path, {"site": SITE | {"origin": origin}})["frames"]
    assert stated == {"frame_id": frame_id, "height_u_m": 0.2}
    previewed = house.post(f"{path}/placement", stated, status=200)
    result = evaluate(house, road)
    assert previewed["place_u_m"] == pytest.approx(result["grid"]["place_u_m"])
    assert [each["placed_by"] for each in result["frames"]] == ["position"]
    truth = np.array([float(illuminate(each["x_m"], each["y_m"])) for each in result["points"]])
    assert figures(result)["e_av"]["low"] < truth.mean() < figures(result)["e_av"]["high"]
    # 0.02 m, 1 degree of 50 m, and 3 degrees of yaw 13.5 m from the middle
    assert result["grid"]["place_u_m"] == pytest.approx(math.hypot(0.02, 0.87, 0.72), rel=0.1)
    assert result["grid"]["view_deg"] == pytest.approx(
        math.degrees(math.atan(math.hypot(13.5, 2.5) / 50)), abs=0.1
    )
    flag = next(each for each in result["findings"] if each["code"] == "road_place_unsure")
    assert "Mark four or more points" in flag["action"]


def test_frames_of_another_place_are_refused_by_name(house, road):
    far = [each | {"x_m": each["x_m"] + 500.0} for each in MARKS]
    frames = [{"frame_id": each["frame_id"], "marks": far} for each in road["frames"]]
    path = f"/v1/roads/{road['id']}"
    house.patch(path, {"frames": frames})
    job = house.post(f"{path}/evaluate", None, status=202)
    house.work()
    job = house.get(f"/v1/jobs/{job['id']}")
    assert (job["state"], job["error"]["code"]) == ("failed", "road_not_seen")


def test_a_wrong_control_point_is_named_and_not_used(house, road):
    path = f"/v1/roads/{road['id']}/points"
    points = house.get(path)["items"]
    points[2]["values"] = [2 * each for each in points[2]["values"]]
    house.put(path, points)
    result = evaluate(house, road)
    states = {each["name"]: each["state"] for each in result["control"]}
    assert [name for name, state in states.items() if state != "agrees"] == ["P3"]
    assert any("P3" in each["where"] + each["detail"] for each in result["flags"]), result["flags"]
    truth = np.array([float(illuminate(each["x_m"], each["y_m"])) for each in result["points"]])
    assert figures(result)["e_av"]["low"] < truth.mean() < figures(result)["e_av"]["high"]


def test_points_map_and_papers_of_an_evaluation(house, evaluated):
    links = evaluated["links"]
    rows = list(csv.DictReader(io.StringIO(house.http.get(links["points.csv"]).text)))
    assert [row["name"] for row in rows] == [each["name"] for each in evaluated["points"]]
    assert float(rows[0]["illuminance_lx"]) == evaluated["points"][0]["illuminance_lx"]
    for name in ("results/1/points.csv", "results/1/points.geojson", "site.geojson"):
        link = f"/v1/roads/{evaluated['road_id']}/{name}"
        kept = {"If-None-Match": house.http.get(link).headers["ETag"]}
        assert house.http.get(link, headers=kept).status_code == 304
    assert house.http.get(links["map.png"]).content.startswith(b"\x89PNG")
    first, second = read_pages(house.http.get(links["report.pdf"]).content)
    for words in ("Conforms to class C4", "EN 13201-2:2015", "T-10A 40027731", "E-2026-0118", "marked"):
        assert words in first, words
    for words in ("Average Eav", "P8", "Measured by"):
        assert words in second, words


def test_what_would_decide_a_verdict_is_answered_and_printed(house, evaluated):
    """At a limit half a standard uncertainty below E_av: 69 % likely; a third of U would do."""
    known = figures(evaluated)["e_av"]
    limit = known["value"] - known["standard_uncertainty"] / 2
    path, criteria = f"/v1/roads/{evaluated['road_id']}", [{"figure": "e_av", "at_least": limit}]
    house.patch(path, {"requirement": REQUIREMENT | {"criteria": criteria}})
    result = evaluate(house, {"id": evaluated["road_id"]})
    (judged,) = result["criteria"]
    assert (result["verdict"], judged["probability"]) == ("not_decided", pytest.approx(0.69, abs=0.03))
    assert judged["needed_u"] == pytest.approx(known["standard_uncertainty"] / 1.645, rel=0.05)
    # the meter alone is 2 % of E_av: no number of points decides
    assert [each["points"] for each in judged["prospects"]] == [4, 8, 16, 40]
    assert {each["is_decided"] for each in judged["prospects"]} == {False}
    assert judged["prospects"][-1]["expanded_uncertainty"] < known["expanded_uncertainty"]
    assert "what would decide it" in read_pages(house.http.get(result["links"]["report.pdf"]).content)[1]


def test_a_site_goes_out_and_in_as_geojson(house, road):
    path = f"/v1/roads/{road['id']}"
    origin = {"longitude_deg": 10.0, "latitude_deg": 53.5, "bearing_deg": 90.0, "y_to_the_right": True}
    placed = house.patch(path, {"site": SITE | {"origin": origin}})
    site = house.get(f"{path}/site.geojson")
    assert site["features"][0]["geometry"]["coordinates"][1][0] > 10.0004  # 30 m to the east
    again = house.put(f"{path}/site.geojson", site)
    for one, other in zip(again["grid"], placed["grid"], strict=True):
        # y = 0 is then at the first luminaire
        assert (one["x_m"], one["y_m"]) == pytest.approx((other["x_m"], other["y_m"] + 1.0), abs=1e-3)
    house.put(f"{path}/site.geojson", site | {"features": []}, status=422)


def test_a_plan_names_points_and_times_and_is_printed_on_two_sides(house, road):
    path = f"/v1/roads/{road['id']}"
    plan = house.get(f"{path}/plan", e_av_u_rel=0.06, u_0_u_rel=0.05)
    assert plan["is_reached"]
    assert plan["e_av_u_rel"] <= 0.06
    assert [each["is_spare"] for each in plan["points"]].count(True) == 1
    # whole half periods of 50 Hz, and never 1/60 s
    assert all(abs(100 * each["time_s"] - round(100 * each["time_s"])) < 1e-9 for each in plan["times"])
    card = read_pages(house.http.get(f"{path}/plan.pdf").content)
    assert len(card) == 2
    assert "Pole A" in card[0]
    assert f"Read {len(plan['points']) - 1} points" in card[1]
