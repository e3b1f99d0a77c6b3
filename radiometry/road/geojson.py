"""Sites and points of a road as GeoJSON, in longitude and latitude, or in metres where no place is known."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radiometry.frame.pose import measure_degree
from radiometry.road import codes
from radiometry.road.site import Area, Origin, Row, Site, Strip

Array = NDArray[np.float64]
Shape = tuple[str, Any, Mapping[str, Any]]
"""Kind of a geometry, its places, and what is stated of it."""

_MOST_SLANT = 0.1  # of a row against the first: what is drawn by hand is not quite parallel
_LEAST_FILLED = 0.85  # share of its bounds along and across the road that the polygon of a strip covers


def turn_axes(origin: Origin) -> Array:
    """Return the east and north of x and of y, as columns."""
    bearing, side = math.radians(origin.bearing_deg), 1.0 if origin.y_to_the_right else -1.0
    x = np.array([math.sin(bearing), math.cos(bearing)])
    return np.column_stack([x, side * np.array([x[1], -x[0]])])


def place_on_earth(site: Site, xy_m: Array) -> Array:
    """Return longitude and latitude of places on a road, (n, 2) [deg]; in metres without an origin."""
    if site.origin is None:
        return xy_m
    start, degree_m = _start(site.origin)
    return xy_m @ turn_axes(site.origin).T / degree_m + start


def place_on_road(origin: Origin, lonlat_deg: Array) -> Array:
    """Return places on a road of longitudes and latitudes, (n, 2) [m]."""
    start, degree_m = _start(origin)
    return np.asarray((lonlat_deg - start) * degree_m @ turn_axes(origin))


def _start(origin: Origin) -> tuple[tuple[float, float], Array]:
    """Return longitude and latitude of an origin, and the lengths of a degree of each there."""
    return (origin.longitude_deg, origin.latitude_deg), measure_degree(origin.latitude_deg)[::-1]


def write_site(site: Site) -> dict[str, Any]:
    """Return a site as GeoJSON: rows as lines from one luminaire to the next, surfaces as polygons.

    Parameters
    ----------
    site : Site
        Luminaires and surfaces.
    """
    low, high = site.field_m
    shapes: list[Shape] = []
    for row in site.rows:
        ends = [(row.first_x_m + along, row.y_m) for along in (0.0, row.spacing_m)]
        shapes.append(("LineString", ends, {"kind": "row", "height_m": row.height_m}))
    for strip in site.strips:
        far = strip.y_m + strip.width_m
        corners = [(low, strip.y_m), (high, strip.y_m), (high, far), (low, far)]
        stated = {"kind": strip.kind, "name": strip.name, "surface": strip.surface}
        shapes.append(("Polygon", corners, stated))
    for area in site.areas:
        stated = {"kind": "area", "name": area.name, "surface": area.surface}
        shapes.append(("Polygon", area.corners_m, stated))
    return _collect(site, shapes)


def write_points(site: Site, points: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    """Return points of a result as GeoJSON.

    Parameters
    ----------
    site : Site
        Site that was evaluated.
    points : iterable of mapping
        Points with their `x_m` and `y_m` [m], and all that is stated of them.
    """
    return _collect(site, (("Point", [(each["x_m"], each["y_m"])], each) for each in points))


def _collect(site: Site, shapes: Iterable[Shape]) -> dict[str, Any]:
    features = []
    for kind, places_m, stated in shapes:
        placed = place_on_earth(site, np.array(places_m, np.float64))
        placed = np.round(placed, 9 if site.origin else 4).tolist()
        forms = {"Point": placed[0], "LineString": placed, "Polygon": [[*placed, placed[0]]]}
        geometry = {"type": kind, "coordinates": forms[kind]}
        features.append({"type": "Feature", "geometry": geometry, "properties": stated})
    unit = "deg" if site.origin else "m"
    return {"type": "FeatureCollection", "coordinates": unit, "features": features}


def read_site(document: Mapping[str, Any]) -> Site:
    """Read a site from GeoJSON as `write_site` writes it.

    x runs from the first luminaire of the first row to the second; y to the side of the first polygon. The
    document's `coordinates` are "deg", or "m" for metres of the road itself.

    Parameters
    ----------
    document : mapping
        FeatureCollection.
    """
    try:
        shapes = [(each["geometry"], each["properties"]) for each in document["features"]]
        lines = [(_list_places(g["coordinates"]), p) for g, p in shapes if g["type"] == "LineString"]
        rings = [(_list_places(g["coordinates"][0][:-1]), p) for g, p in shapes if g["type"] == "Polygon"]
        origin = None
        if document.get("coordinates", "deg") == "deg":
            origin = _find_origin(lines[0][0], rings[0][0])

        def lay(places: Array) -> Array:
            return np.round(places if origin is None else place_on_road(origin, places), 4)

        return Site(
            rows=tuple(_read_row(lay(line), stated) for line, stated in lines),
            strips=tuple(_read_strip(lay(ring), p) for ring, p in rings if p["kind"] != "area"),
            areas=tuple(_read_area(lay(ring), p) for ring, p in rings if p["kind"] == "area"),
            origin=origin,
        )
    except (KeyError, IndexError, TypeError, ValueError):
        raise codes.SITE_INVALID.refuse(
            "The GeoJSON is not that of a site: rows are LineStrings with `height_m`, surfaces are Polygons "
            "with `kind` and `name`."
        ) from None


def _list_places(coordinates: Any) -> Array:  # noqa: ANN401  whatever was sent
    return np.array(coordinates, np.float64)[:, :2]


def _find_origin(line_deg: Array, ring_deg: Array) -> Origin:
    longitude, latitude = line_deg[0].tolist()
    start = Origin(longitude_deg=longitude, latitude_deg=latitude, bearing_deg=0.0, y_to_the_right=True)
    north, east = place_on_road(start, line_deg[1:2])[0].tolist()
    ahead = replace(start, bearing_deg=math.degrees(math.atan2(east, north)) % 360.0)
    return replace(ahead, y_to_the_right=bool(place_on_road(ahead, ring_deg)[:, 1].mean() >= 0.0))


def _read_row(line_m: Array, stated: Mapping[str, Any]) -> Row:
    (x, y), (to, beside) = line_m[:2].tolist()
    if abs(beside - y) > _MOST_SLANT * abs(to - x):
        raise codes.SITE_INVALID.refuse("Two luminaires of a row lie across the road: x runs along the rows.")
    return Row(y_m=y, height_m=float(stated["height_m"]), spacing_m=to - x, first_x_m=x)


def _read_strip(ring_m: Array, stated: Mapping[str, Any]) -> Strip:
    near, far = float(ring_m[:, 1].min()), float(ring_m[:, 1].max())
    x, y = (ring_m - ring_m[0]).T
    area_m2 = abs(float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))) / 2.0
    if area_m2 < _LEAST_FILLED * float(np.ptp(x)) * (far - near):
        raise codes.SITE_INVALID.refuse(
            f"The polygon of {stated['name']} is no rectangle along the first row of luminaires: straighten "
            "it, or give it the kind area."
        )
    return Strip(**_name(stated), kind=stated["kind"], y_m=near, width_m=far - near)


def _read_area(ring_m: Array, stated: Mapping[str, Any]) -> Area:
    return Area(**_name(stated), corners_m=tuple((x, y) for x, y in ring_m.tolist()))


def _name(stated: Mapping[str, Any]) -> dict[str, str]:
    return {"name": str(stated["name"]), "surface": str(stated.get("surface", "asphalt"))}
