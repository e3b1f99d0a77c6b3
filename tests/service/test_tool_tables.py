"""The calculators take a table as a spreadsheet writes it."""

import pytest

from tests.service.test_tools import COVERAGE


@pytest.fixture(scope="module")
def house(sqlite_house):
    """One for all: the calculators store nothing."""
    return sqlite_house


def ask_table(house, tool, text):
    return house.http.post(
        f"/v1/tools/{tool}", content=text.encode(), headers={"Content-Type": "text/csv; charset=utf-8"}
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
    assert ask_table(house, "motion.svg", text).headers["Content-Type"].startswith("image/svg+xml")


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
