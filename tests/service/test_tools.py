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
TABLE_3 = {
    100: ("1.66", "0.72", "37.3", "55.9"),
    200: ("0.83", "0.36", "18.6", "28.0"),
    400: ("0.41", "0.18", "9.3", "14.0"),
    500: ("0.33", "0.14", "7.5", "11.2"),
    640: ("0.26", "0.11", "5.8", "8.7"),
    800: ("0.21", "0.09", "4.7", "7.0"),
    1000: ("0.17", "0.07", "3.7", "5.6"),
    1250: ("0.13", "0.06", "3.0", "4.5"),
    2000: ("0.08", "0.04", "1.9", "2.8"),
}


@pytest.fixture(scope="module")
def house(sqlite_house):
    """One for all: the calculators store nothing."""
    return sqlite_house


def ask(house, tool, body, status=200):
    return house.post(f"/v1/tools/{tool}", body, status=status)


def test_table_3_in_one_request(house):
    cases = [
        MOTION | {"exposure_time_s": 1 / inverse, "focal_length_mm": c, "rotation_rate_deg_s": 360 * 0.46}
        for inverse in TABLE_3
        for c in (6, 9)
    ]
    items = ask(house, "motion", cases)["items"]
    for (short, long), printed in zip(
        zip(items[::2], items[1::2], strict=True), TABLE_3.values(), strict=True
    ):
        assert f"{long['rotation_angle_deg']:.2f}" == printed[0]
        assert f"{long['rotation_ground_m']:.2f}" == printed[1]
        assert f"{short['rotation_blur_px']:.1f}" == printed[2]
        assert f"{long['rotation_blur_px']:.1f}" == printed[3]


def test_one_lens_has_the_contracts_fields(house):
    answer = ask(
        house, "motion", MOTION | {"rotation_rate_deg_s": 165.6, "ground_speed_m_s": 15, "limit_px": 0.5}
    )
    assert answer["tolerable_rate_deg_s"] == pytest.approx(11.84, abs=0.005)
    both = answer["rotation_blur_px"] + answer["forward_blur_px"]
    assert answer["theoretical_blur_px"] == pytest.approx(both)
    assert answer["practical_blur_px"] == pytest.approx(both / 2)
    assert answer["longest_exposure_s"] == pytest.approx(0.5 / both / 800)


@pytest.mark.parametrize("speed", [{"ground_speed_m_s": 15}, {"ground_speed_km_h": 54}])
@pytest.mark.parametrize(("focal_length_mm", "blur_px"), [(6, 0.484), (9, 0.726)])
def test_speed_in_either_unit_by_its_own_name(house, speed, focal_length_mm, blur_px):
    case = MOTION | {"focal_length_mm": focal_length_mm, "exposure_time_s": 1 / 400, "distance_m": 100}
    answer = ask(house, "motion", case | speed)
    assert answer["forward_blur_px"] == pytest.approx(blur_px, abs=5e-4)
    assert answer["ground_speed_m_s"] == pytest.approx(15)


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


def test_coverage_of_a_rig(house):
    sides = [
        COVERAGE | {"name": f"side {azimuth}", "tilt_deg": 45, "azimuth_deg": azimuth}
        for azimuth in (0, 90, 180, 270)
    ]
    items = ask(house, "coverage", [COVERAGE | {"name": "nadir", "focal_length_mm": 6}, *sides])["items"]
    assert [item["name"] for item in items] == ["nadir", "side 0", "side 90", "side 180", "side 270"]
    ahead = items[1]["footprint"][0][1]
    assert items[3]["footprint"][0][1] == pytest.approx(-ahead)
    assert len({round(item["far_m"], 9) for item in items[1:]}) == 1


def test_a_horizon_is_named_and_no_infinity(house):
    answer = ask(house, "coverage", COVERAGE | {"tilt_deg": 80})
    assert answer["horizon_in_view"] is True
    assert {"far_m", "gsd_far_m", "footprint"}.isdisjoint(answer)
    assert answer["missing"].startswith("far_m, gsd_far_m")
    assert "94.9 degrees" in answer["missing"]


def test_a_thousand_cases_are_computed_and_more_are_refused(house):
    assert len(ask(house, "motion", [MOTION] * 1000)["items"]) == 1000
    ask(house, "motion", [MOTION] * 1001, status=422)


def read_series(name):
    with data_file(f"nikon-d70/{name}").open() as lines:
        return [{name: float(value) for name, value in row.items()} for row in csv.DictReader(lines)]


def fit(house, rows, dark_dn):
    return ask(house, "exposure", {"rows": rows, "dark_dn": dark_dn, "white_level_dn": 16384})


@pytest.mark.parametrize(("channel", "dark_dn"), [("R", 1), ("G", 8), ("B", 2)])
def test_the_nikon_series_in_time(house, channel, dark_dn):
    rows = [
        {"exposure_time_s": r["exposure_s"], "f_number": r["f_number"], "iso": 200, "signal_dn": r[channel]}
        for r in read_series("exposure_series.csv")
    ]
    one = fit(house, [row for row in rows if row["f_number"] == 11], dark_dn)
    assert list(one["exponents"]) == ["exposure_time_s"]
    assert 1.00 <= one["exponents"]["exposure_time_s"]["value"] <= 1.02
    both = fit(house, rows, dark_dn)
    assert 1.00 <= both["exponents"]["exposure_time_s"]["value"] <= 1.02
    assert both["used"] + len(both["left_out"]) == len(rows)
    assert {"row", "reason"} == set(both["left_out"][0])


@pytest.mark.parametrize(("channel", "dark_dn"), [("R", 1), ("Gr", 8), ("Gb", 8), ("B", 2)])
def test_the_nikon_series_in_iso(house, channel, dark_dn):
    rows = [
        {"exposure_time_s": 0.004, "f_number": 2.8, "iso": r["iso"], "signal_dn": r[channel]}
        for r in read_series("iso_series_t1_250_f2.8.csv")
    ]
    exponent = fit(house, rows, dark_dn)["exponents"]["iso"]
    assert 0.98 <= exponent["value"] <= 1.04
    assert 0 < exponent["standard_uncertainty"] < 0.02
    assert exponent["unit"] == "1"


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
