"""The calculators through HTTP: the source's numbers, and refusals."""

import csv

import pytest
from sqlalchemy import func, select

from store.tables import IdempotentAnswer
from tests.support.data import data_file

MOTION = {"pixel_pitch_um": 4.65, "focal_length_mm": 9, "exposure_time_s": 1 / 800, "distance_m": 25}
COVERAGE = {
    "height_m": 50,
    "tilt_deg": 0,
    "focal_length_mm": 9,
    "sensor_width_mm": 6.4,
    "sensor_height_mm": 4.8,
    "pixel_pitch_um": 4.65,
}


@pytest.fixture(scope="module")
def house(sqlite_house):
    """One for all: the calculators store nothing."""
    return sqlite_house


def ask(house, tool, body, status=200):
    return house.post(f"/v1/tools/{tool}", body, status=status)


def test_one_lens_has_the_contracts_fields(house):
    answer = ask(
        house, "motion", MOTION | {"rotation_rate_deg_s": 165.6, "ground_speed_m_s": 15, "limit_px": 0.5}
    )
    assert answer["tolerable_rate_deg_s"] == pytest.approx(11.84, abs=0.005)
    both = answer["rotation_blur_px"] + answer["forward_blur_px"]
    assert answer["theoretical_blur_px"] == pytest.approx(both)
    assert answer["practical_blur_px"] == pytest.approx(both / 2)
    assert answer["longest_exposure_s"] == pytest.approx(0.5 / both / 800)


def test_what_does_not_exist_is_absent(house):
    answer = ask(house, "motion", MOTION)
    assert sorted(answer) == ["gsd_m", "limit_px", "tolerable_rate_deg_s"]


@pytest.mark.parametrize(
    ("tool", "body", "field", "message"),
    [
        ("motion", MOTION | {"ground_speed_m_s": 15, "ground_speed_km_h": 54}, "body", "not both"),
        ("motion", MOTION | {"ground_speed": 15}, "body.ground_speed", "is not known here"),
        ("motion", MOTION | {"distance_m": 0}, "body.distance_m", "greater than or equal to 0.001"),
        (
            "motion",
            MOTION | {"rotation_rate_deg_s": -3},
            "body.rotation_rate_deg_s",
            "greater than or equal to 0",
        ),
        ("motion", MOTION | {"exposure_time_s": True}, "body.exposure_time_s", "must be a number"),
        ("motion", [MOTION, MOTION | {"limit_px": None}], "body.1.limit_px", "null is not a value"),
        ("motion", [], "body", "must have at least 1 item, not 0"),
        ("coverage", COVERAGE | {"tilt_deg": 89.9999999999}, "body.tilt_deg", "less than or equal to 89.99"),
        ("exposure", {"rows": [], "white_level_dn": 1000}, "body.rows", "at least 1 item"),
    ],
)
def test_a_wrong_field_is_named(house, tool, body, field, message):
    (error,) = ask(house, tool, body, status=422)["errors"]
    assert error["field"] == field
    assert message in error["message"]


@pytest.mark.parametrize(("height_m", "gsd_m"), [(50, 0.0258), (300, 0.155)])
def test_coverage_of_a_nadir_camera(house, height_m, gsd_m):
    answer = ask(house, "coverage", COVERAGE | {"height_m": height_m})
    assert answer["gsd_centre_m"] == pytest.approx(gsd_m, rel=2e-3)
    assert answer["fov_deg"] == pytest.approx({"horizontal": 39.15, "vertical": 29.86}, abs=0.005)
    assert len(answer["footprint"]) == 4


def test_a_horizon_is_named_and_no_infinity(house):
    answer = ask(house, "coverage", COVERAGE | {"tilt_deg": 80})
    assert answer["horizon_in_view"] is True
    assert {"far_m", "gsd_far_m", "footprint"}.isdisjoint(answer)
    assert answer["missing"].startswith("far_m, gsd_far_m")
    assert "94.9 degrees" in answer["missing"]


def test_a_thousand_cases_are_computed_and_more_are_refused(house):
    assert len(ask(house, "motion", [MOTION] * 1000)["items"]) == 1000
    ask(house, "motion", [MOTION] * 1001, status=422)


def test_a_series_that_says_nothing_is_refused(house):
    row = {"exposure_time_s": 0.01, "f_number": 4, "iso": 100, "signal_dn": 500}
    problem = ask(house, "exposure", {"rows": [row] * 4, "white_level_dn": 4095}, status=422)
    assert problem["code"] == "fit_incomplete"
    assert "vary exposure time, f-number or ISO" in problem["detail"]


def test_a_key_is_taken_and_nothing_is_stored(house):
    key = {"Idempotency-Key": "motion"}
    first, again = (house.http.post("/v1/tools/motion", json=MOTION, headers=key) for _ in range(2))
    assert (first.status_code, first.json()) == (again.status_code, again.json()) == (200, first.json())
    with house.database.reading() as session:
        assert session.scalar(select(func.count()).select_from(IdempotentAnswer)) == 0


@pytest.mark.parametrize("tool", ["motion", "coverage", "exposure"])
def test_reading_is_enough_and_needed(house, tool):
    body = [MOTION] if "motion" in tool else [COVERAGE]
    if tool == "exposure":
        row = {"exposure_time_s": 0.01, "f_number": 4, "iso": 100, "signal_dn": 500}
        rows = [row | {"exposure_time_s": 0.01 * k, "signal_dn": 500 * k} for k in (1, 2, 3)]
        body = {"rows": rows, "white_level_dn": 4095}
    for scope, status in (("read", 200), ("upload", 403)):
        secret = house.post("/v1/keys", {"name": scope, "scopes": [scope]})["secret"]
        with house.with_key(secret) as client:
            assert client.post(f"/v1/tools/{tool}", json=body).status_code == status


def ask_table(house, tool, text, **query):
    return house.http.post(
        f"/v1/tools/{tool}",
        content=text.encode(),
        headers={"Content-Type": "text/csv; charset=utf-8"},
        params=query or None,
    )


def test_a_table_is_a_list(house):
    """As a German spreadsheet writes it; an empty cell says nothing."""
    text = (
        "name;pixel_pitch_um;focal_length_mm;exposure_time_s;distance_m;ground_speed_km_h\r\n"
        "6 mm;4,65;6;0,0025;100;54\r\n"
        "still;4,65;9;0,00125;25;\r\n"
    )
    answer = ask_table(house, "motion", text)
    assert answer.status_code == 200, answer.text
    moved, still = answer.json()["items"]
    assert (moved["name"], moved["ground_speed_m_s"]) == ("6 mm", pytest.approx(15.0))
    assert moved["forward_blur_px"] == pytest.approx(0.484, abs=5e-4)
    assert "forward_blur_px" not in still
    assert still["tolerable_rate_deg_s"] == pytest.approx(11.84, abs=5e-3)
    columns = [name for name in COVERAGE if name != "tilt_deg"]
    cells = ",".join(str(COVERAGE[name]) for name in columns)
    rig = f"{','.join(columns)},tilt_deg,azimuth_deg\n" + "".join(f"{cells},45,{a}\n" for a in (0, 90))
    ahead, right = ask_table(house, "coverage", rig).json()["items"]
    assert [right["footprint"][2][0], right["footprint"][2][1]] == pytest.approx(
        [ahead["footprint"][2][1], -ahead["footprint"][2][0]]
    )


@pytest.mark.parametrize(
    ("text", "field", "said"),
    [
        ("focal_length,distance_m\n9,25\n", "line 1", "it names 'focal_length', 'distance_m'"),
        ("distance_m,distance_m\n9,25\n", "line 1", "each at most once"),
        ("focal_length_mm,distance_m\n", "csv", "must hold 1 to 1000 cases below its first line"),
        ("", "csv", "must hold 1 to 1000 cases below its first line"),
        (
            "pixel_pitch_um,focal_length_mm,exposure_time_s,distance_m\n4.65,9,1/800,25\n",
            "line 2.exposure_time_s",
            "must be a number",
        ),
        (
            "pixel_pitch_um,focal_length_mm,exposure_time_s,distance_m\n4,65,9,0.001,25\n",
            "line 2",
            "has more cells than line 1 names",
        ),
    ],
)
def test_a_table_names_the_line_that_is_wrong(house, text, field, said):
    answer = ask_table(house, "motion", text)
    assert answer.status_code == 422
    (error,) = answer.json()["errors"]
    assert error["field"] == field
    assert said in error["message"]


SERIES = "exposure_time_s,f_number,iso,signal_dn\n" + "".join(
    f"{time},11,200,{signal}\n" for time, signal in ((0.01, 373), (0.02, 752), (0.04, 1472), (0.1, 3780))
)


def test_a_series_as_a_table_has_the_answer_of_the_same_rows(house):
    rows = [{name: float(cell) for name, cell in row.items()} for row in csv.DictReader(SERIES.splitlines())]
    body = {"rows": rows, "dark_dn": 8, "white_level_dn": 16384}
    answer = ask_table(house, "exposure", SERIES, white_level_dn=16384, dark_dn=8)
    assert answer.status_code == 200, answer.text
    assert answer.json() == house.post("/v1/tools/exposure", body, status=200)
    semicolons = SERIES.replace(",", ";").replace(".", ",")
    assert ask_table(house, "exposure", semicolons, white_level_dn=16384, dark_dn=8).json() == answer.json()


def test_a_row_may_state_what_the_query_says_of_the_others(house):
    text = "exposure_s,dark_dn,g1\n0.01,8,372\n0.02,,752\n0.04,,1480\n0.1,8,3648\n"
    answer = ask_table(house, "exposure", text, white_level_dn=16384, dark_dn=24, f_number=4, iso=100)
    # 364, 728, 1456 and 3640 above dark: linear, only when each row has the dark signal meant for it
    exponent = answer.json()["exponents"]["exposure_time_s"]
    assert exponent["value"] == pytest.approx(1.0, abs=1e-12)
    assert list(answer.json()["exponents"]) == ["exposure_time_s"]


def read_text(name):
    return data_file(f"nikon-d70/{name}").read_text()


@pytest.mark.parametrize(("channel", "dark_dn"), [("R", 1), ("G", 8), ("B", 2)])
def test_the_nikon_s_own_tables_are_taken_as_they_are(house, channel, dark_dn):
    told = {"white_level_dn": 16384, "dark_dn": dark_dn}
    series = read_text("exposure_series.csv")
    answer = ask_table(house, "exposure", series, signal=channel, iso=200, **told).json()
    assert 1.00 <= answer["exponents"]["exposure_time_s"]["value"] <= 1.02
    assert answer["used"] + len(answer["left_out"]) == len(series.splitlines()) - 1
    text = read_text("iso_series_t1_250_f2.8.csv")
    column = {"G": "Gr"}.get(channel, channel)
    answer = ask_table(house, "exposure", text, signal=column, exposure_time_s=0.004, f_number=2.8, **told)
    assert 0.98 <= answer.json()["exponents"]["iso"]["value"] <= 1.04
    text = read_text("aperture_series_t1_250.csv")
    answer = ask_table(house, "exposure", text, signal=channel, exposure_time_s=0.004, iso=200, **told)
    assert answer.json()["exponents"]["f_number"]["value"] == pytest.approx(-2.04, abs=0.04)


@pytest.mark.parametrize(
    ("text", "query", "field", "said"),
    [
        (SERIES, {}, "query.white_level_dn", "is missing: a table does not say it"),
        (SERIES, {"white_level_dn": 0}, "query.white_level_dn", "greater than 0"),
        (SERIES, {"white": 9}, "query.white", "is not known here"),
        (SERIES, {"white_level_dn": 9, "signal": "G"}, "query.signal", "there is no such column"),
        ("iso,R,G\n1,2,3\n", {"white_level_dn": 9}, "line 1", "the signals of r, g; name one in the query"),
        ("iso\n1\n", {"white_level_dn": 9}, "line 1", "lacks signal_dn"),
        ("f_number,iso,G\n1,2,3\n", {"white_level_dn": 9}, "line 1", "lacks exposure_time_s; add its column"),
        (
            "exposure_s,exposure_time_s,f_number,iso,G\n1,1,1,2,3\n",
            {"white_level_dn": 9},
            "line 1",
            "each at most once",
        ),
        (
            "exposure_s,f_number,iso,G,light\n1,1,1,2,3\n",
            {"white_level_dn": 9},
            "line 1",
            "names 'exposure_s'",
        ),
        ("exposure_s,f_number,iso,G,\n1,1,1,2,\n", {"white_level_dn": 9}, "line 1", "each at most once"),
        (SERIES + "1/50,11,200,99\n", {"white_level_dn": 9}, "line 6.exposure_time_s", "must be a number"),
        (SERIES + "0.1,11,200,nan\n", {"white_level_dn": 9}, "line 6.signal_dn", "must be a number"),
        (SERIES + "0.1,11,,9\n", {"white_level_dn": 9}, "line 6.iso", "is missing"),
        (SERIES.splitlines()[0], {"white_level_dn": 9}, "csv", "must hold 1 to 10000 rows"),
    ],
)
def test_a_series_names_what_is_wrong_with_it(house, text, query, field, said):
    answer = ask_table(house, "exposure", text, **query)
    assert answer.status_code == 422, answer.text
    (error,) = answer.json()["errors"]
    assert error["field"] == field
    assert said in error["message"]


def test_what_a_body_says_is_not_said_in_the_query_too(house):
    body = {"rows": [], "white_level_dn": 9}
    answer = house.http.post("/v1/tools/exposure", json=body, params={"dark_dn": 3})
    (error,) = answer.json()["errors"]
    assert error["field"] == "query.dark_dn"
    assert "in JSON it stands in the body" in error["message"]
