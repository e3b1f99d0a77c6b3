"""Sites and points of a road as GeoJSON, in longitude and latitude, or in metres where no place is known."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radiometry.frame.pose import measure_degree
from radiometry.road import codes
from radiometry.road.results import RoadResult
from radiometry.road.site import Area, Origin, Row, Site, Strip

Array = NDArray[np.float64]


def turn_axes(origin: Origin) -> Array:
    """Return the east and north of x and of y, as columns."""
    bearing, side = math.radians(origin.bearing_deg), 1.0 if origin.y_to_the_right else -1.0
    x = np.array([math.sin(bearing), math.cos(bearing)])
    return np.column_stack([x, side * np.array([x[1], -x[0]])])


def place_on_earth(site: Site, xy_m: Array) -> Array:
    """Return longitude and latitude of places on a road, (n, 2) [deg]; in metres without an origin."""
    if site.origin is None:
        return xy_m
    return xy_m @ turn_axes(site.origin).T / _measure_degree(site.origin) + _start(site.origin)


def place_on_road(origin: Origin, lonlat_deg: Array) -> Array:
    """Return places on a road of longitudes and latitudes, (n, 2) [m]."""
    return np.asarray((lonlat_deg - _start(origin)) * _measure_degree(origin) @ turn_axes(origin))


def _start(origin: Origin) -> tuple[float, float]:
    return origin.longitude_deg, origin.latitude_deg


def _measure_degree(origin: Origin) -> Array:
    return measure_degree(origin.latitude_deg)[::-1]


def write_site(site: Site) -> dict[str, Any]:
    """Return a site as GeoJSON: rows as lines from one luminaire to the next, surfaces as polygons.

    Parameters
    ----------
    site : Site
        Luminaires and surfaces.
    """
    low, high = site.field_m
    features = []
    for row in site.rows:
        ends = [(row.first_x_m + along, row.y_m) for along in (0.0, row.spacing_m)]
        features.append(_write(site, "LineString", ends, {"kind": "row", "height_m": row.height_m}))
    for strip in site.strips:
        far = strip.y_m + strip.width_m
        corners = [(low, strip.y_m), (high, strip.y_m), (high, far), (low, far)]
        stated = {"kind": strip.kind, "name": strip.name, "surface": strip.surface}
        features.append(_write(site, "Polygon", corners, stated))
    for area in site.areas:
        stated = {"kind": "area", "name": area.name, "surface": area.surface}
        features.append(_write(site, "Polygon", list(area.corners_m), stated))
    return _collect(site, features)


def write_points(site: Site, result: RoadResult) -> dict[str, Any]:
    """Return grid points and control points of a result as GeoJSON.

    Parameters
    ----------
    site : Site
        Site that was evaluated.
    result : RoadResult
        Its evaluation.
    """
    stated = [*map(asdict, result.points), *map(asdict, result.control)]
    features = [_write(site, "Point", [(each["x_m"], each["y_m"])], each) for each in stated]
    return _collect(site, features)


def _write(site: Site, kind: str, places_m: Any, stated: dict[str, Any]) -> dict[str, Any]:  # noqa: ANN401
    placed = np.round(place_on_earth(site, np.array(places_m, np.float64)), 9 if site.origin else 4).tolist()
    forms = {"Point": placed[0], "LineString": placed, "Polygon": [[*placed, placed[0]]]}
    return {"type": "Feature", "geometry": {"type": kind, "coordinates": forms[kind]}, "properties": stated}


def _collect(site: Site, features: list[dict[str, Any]]) -> dict[str, Any]:
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
        lines, polygons = (list(_list_shapes(document, kind)) for kind in ("LineString", "Polygon"))
        origin = None
        if document.get("coordinates", "deg") == "deg":
            origin = _find_origin(lines[0][0], polygons[0][0])
            lines, polygons = (
                [(place_on_road(origin, places), stated) for places, stated in each]
                for each in (lines, polygons)
            )
        areas = [(ring, stated) for ring, stated in polygons if stated["kind"] == "area"]
        return Site(
            rows=tuple(_read_row(places, float(stated["height_m"])) for places, stated in lines),
            strips=tuple(_read_strip(ring, p) for ring, p in polygons if p["kind"] != "area"),
            areas=tuple(
                Area(**_name(p), corners_m=tuple(map(tuple, np.round(r, 4).tolist()))) for r, p in areas
            ),
            origin=origin,
        )
    except (KeyError, IndexError, TypeError, ValueError):
        raise codes.SITE_INVALID.refuse(
            "The GeoJSON is not that of a site: rows are LineStrings with `height_m`, surfaces are Polygons "
            "with `kind` and `name`."
        ) from None


def _list_shapes(document: Mapping[str, Any], kind: str) -> Iterator[tuple[Array, Mapping[str, Any]]]:
    """Yield places and properties of the lines, or of the polygons without their last corner."""
    for feature in document["features"]:
        geometry = feature["geometry"]
        if geometry["type"] == kind:
            places = geometry["coordinates"][0][:-1] if kind == "Polygon" else geometry["coordinates"]
            yield np.array(places, np.float64)[:, :2], feature["properties"]


def _find_origin(line_deg: Array, polygon_deg: Array) -> Origin:
    longitude, latitude = line_deg[0].tolist()
    start = Origin(longitude_deg=longitude, latitude_deg=latitude, bearing_deg=0.0, y_to_the_right=True)
    north, east = place_on_road(start, line_deg[1:2])[0].tolist()
    ahead = replace(start, bearing_deg=math.degrees(math.atan2(east, north)) % 360.0)
    return replace(ahead, y_to_the_right=bool(place_on_road(ahead, polygon_deg)[:, 1].mean() >= 0.0))


def _name(stated: Mapping[str, Any]) -> dict[str, str]:
    return {"name": str(stated["name"]), "surface": str(stated.get("surface", "asphalt"))}


def _round(places_m: Array) -> tuple[tuple[float, float], ...]:
    return tuple((x, y) for x, y in np.round(places_m, 4).tolist())


def _read_row(places_m: Array, height_m: float) -> Row:
    (x, y), (to, _) = _round(places_m[:2])
    return Row(y_m=y, height_m=height_m, spacing_m=to - x, first_x_m=x)


def _read_strip(ring_m: Array, stated: Mapping[str, Any]) -> Strip:
    near, far = np.round([ring_m[:, 1].min(), ring_m[:, 1].max()], 4).tolist()
    return Strip(**_name(stated), kind=stated["kind"], y_m=near, width_m=far - near)
