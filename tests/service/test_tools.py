"""The calculators through HTTP: the source's numbers, and refusals."""

import pytest
from sqlalchemy import func, select

from store.tables import IdempotentAnswer

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
