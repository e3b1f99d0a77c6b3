"""Panels are dated objects: the same twice is one, and measured again it is another."""

import pytest

pytestmark = pytest.mark.either_database

PANEL = {
    "serial": "RP02-1603036-SC",
    "measured_on": "2026-03-14",
    "bands": [
        {"band": "red", "reflectance": 0.68, "standard_uncertainty": 0.005},
        {"band": "green", "reflectance": 0.69},
    ],
}


def test_a_panel_is_registered_once(house):
    first = house.post("/v1/panels", PANEL)
    again = house.post("/v1/panels", PANEL | {"bands": PANEL["bands"][::-1]}, status=200)
    assert again == first
    assert [band["band"] for band in first["bands"]] == ["green", "red"]
    assert "standard_uncertainty" not in first["bands"][0]
    assert house.get(f"/v1/panels/{first['id']}") == first
    assert house.get("/v1/panels")["items"] == [first]


def test_a_band_is_known_by_every_way_to_write_it(house):
    written = [{"band": name, "reflectance": 0.5} for name in ("NIR", "Red edge", "Green")]
    panel = house.post("/v1/panels", PANEL | {"bands": written})
    assert [band["band"] for band in panel["bands"]] == ["green", "nir", "red_edge"]


def test_figures_are_corrected_and_another_day_is_another_measurement(house):
    first = house.post("/v1/panels", PANEL)
    other = PANEL | {"bands": [{"band": "green", "reflectance": 0.5}]}
    corrected = house.post("/v1/panels", other, status=200)
    assert corrected == first | {"bands": other["bands"]} == house.get(f"/v1/panels/{first['id']}")
    later = house.post("/v1/panels", PANEL | {"measured_on": "2026-06-01"})
    assert later["id"] != first["id"]


def test_figures_that_cannot_be_are_refused_by_name(house):
    green = {"band": "green", "reflectance": 0.5}
    for bands, field in (
        ([], "body.bands"),
        ([green | {"reflectance": 0.0}], "body.bands.0.reflectance"),
        ([green | {"reflectance": 18}], "body.bands.0.reflectance"),
        ([green | {"band": "RedEdge"}, green | {"band": "red edge"}], "body"),
        ([green] * 2, "body"),
    ):
        problem = house.post("/v1/panels", PANEL | {"bands": bands}, status=422)
        assert problem["code"] == "validation_failed"
        assert [error["field"] for error in problem["errors"]] == [field]
