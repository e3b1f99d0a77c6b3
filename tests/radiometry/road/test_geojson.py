"""Sites and points of a road as GeoJSON."""

import dataclasses

import numpy as np
import pytest

from radiometry.findings import InputRejected
from radiometry.road.geojson import place_on_earth, read_site, write_points, write_site
from radiometry.road.site import Area, Origin, Row, Strip
from tests.radiometry.road.test_grid import make_site

ORIGIN = Origin(longitude_deg=8.5, latitude_deg=47.0, bearing_deg=60.0)


def make_full(**changes):
    walkway = Strip(name="footway", kind="walkway", y_m=8.0, width_m=2.0, surface="slabs")
    site = make_site(35.0, walkway, areas=(Area(name="corner", corners_m=((0, 7), (9, 7), (0, 15))),))
    rows = (dataclasses.replace(site.rows[0], y_m=0.0), Row(y_m=8, height_m=9, spacing_m=35, first_x_m=17.5))
    return dataclasses.replace(site, rows=rows, **changes)


@pytest.mark.parametrize(
    "origin", [None, ORIGIN, dataclasses.replace(ORIGIN, y_to_the_right=True, bearing_deg=211.0)]
)
def test_a_site_returns(origin):
    site = make_full(origin=origin)
    back = read_site(write_site(site))
    assert [dataclasses.astuple(each)[2:3] for each in back.strips] == [(0.0,), (3.5,), (8.0,)]
    for ours, theirs in zip((*site.strips, *site.rows), (*back.strips, *back.rows), strict=True):
        for name, value in dataclasses.asdict(ours).items():
            found = getattr(theirs, name)
            assert found == (value if isinstance(value, str) else pytest.approx(value, abs=2e-3))
    assert np.array(back.areas[0].corners_m) == pytest.approx(np.array(site.areas[0].corners_m), abs=2e-3)
    if origin:
        assert back.origin.bearing_deg == pytest.approx(origin.bearing_deg, abs=0.01)
        assert back.origin.y_to_the_right == origin.y_to_the_right


def test_places_are_as_far_as_degrees_are_long():
    """At 47 degrees north a degree of latitude has 111 174 m and one of longitude 76 056 m (WGS 84)."""
    north = dataclasses.replace(ORIGIN, bearing_deg=0.0)
    placed = place_on_earth(make_full(origin=north), np.array([(111.174, 0.0), (0.0, 76.056)]))
    assert placed - (8.5, 47.0) == pytest.approx(np.array([(0.0, 1e-3), (-1e-3, 0.0)]), abs=2e-7)


def test_points_are_features_with_their_figures():
    point = {"name": "1/1-1", "x_m": 3.0, "y_m": 0.5, "illuminance_lx": 12.0}
    (found,) = write_points(make_full(origin=None), [point])["features"]
    assert found["geometry"] == {"type": "Point", "coordinates": [3.0, 0.5]}
    assert found["properties"] == point


@pytest.mark.parametrize(("feature", "match"), [(0, "across the road"), (2, "1 is no rectangle")])
def test_what_runs_across_the_road_is_refused(feature, match):
    """A row is read by its spacing along x, and a strip by its bounds: slanted, both would be others."""
    document = write_site(make_full(origin=None))
    geometry = document["features"][feature]["geometry"]
    places = geometry["coordinates"] if geometry["type"] == "LineString" else geometry["coordinates"][0]
    places[1][1] += 5.0
    with pytest.raises(InputRejected, match=match):
        read_site(document)


@pytest.mark.parametrize("document", [{}, {"features": [{"geometry": None}]}, {"features": []}])
def test_what_is_no_site_is_refused(document):
    with pytest.raises(InputRejected, match="GeoJSON"):
        read_site(document)
