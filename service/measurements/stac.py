"""The numbers of a measurement's map as JSON, and its STAC item for catalogues of imagery."""

import hashlib
import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any, Final
from xml.etree import ElementTree as ET
from xml.sax.saxutils import unescape

from fastapi import Query, Request, Response

from service.http import answers, auth, connections, lookup, operations, problems
from service.http.context import UsesContext
from service.measurements import lists, maps
from store.blobs import prove_file
from store.queries.frame_times import Zones, read_frame_time
from store.tables import Calibration, FrameRow, Measurement

STAC_VERSION: Final = "1.0.0"
_EXTENSION: Final = "https://stac-extensions.github.io/{}/v1.1.0/schema.json"
_GDAL_METADATA: Final = "GDAL_METADATA"
_FIRST_DAY: Final = "1970-01-01T00:00:00Z"


def describe_map(path: Path) -> dict[str, Any]:
    """Return the size of a map and the items of each plane, as its own file states them."""
    import tifffile

    with tifffile.TiffFile(path) as file:
        page = file.pages.first
        tag = page.tags.get(_GDAL_METADATA)
        metadata = tag.value if tag else "<GDALMetadata/>"
        said: dict[str, Any] = {
            "shape": [page.imagelength, page.imagewidth],
            "data_type": str(page.dtype),
            "description": json.loads(page.description),
        }
    planes: dict[int, dict[str, str]] = {}
    # written by this product: no document of a stranger
    for each in ET.fromstring(metadata):  # noqa: S314
        if "sample" in each.attrib:
            planes.setdefault(int(each.attrib["sample"]), {})[each.attrib["name"]] = unescape(each.text or "")
    return said | {"planes": [planes[number] for number in sorted(planes)]}


def make_item(
    row: Measurement, frame: FrameRow, calibration: Calibration, found: dict[str, Any], *, base: str
) -> dict[str, Any]:
    """Make the item of a map of `describe_map`; without geometry where the map is not placed.

    ``base`` : address of the measurement's service, ahead of its paths
    """
    place, quantity = row.result.get("place", {}), found["description"]["quantity"]
    own, placed = f"{base}/v1/measurements/{row.id}", place.get("corners") or []
    ring = [*placed[:1], *placed[::-1]]  # counterclockwise
    area = {} if not placed else {"bbox": [f(at) for f in (min, max) for at in zip(*placed, strict=True)]}
    bands = [_describe_band(plane, found["data_type"], place) for plane in found["planes"]]
    colours = [_describe_colour(plane) for plane in found["planes"]]
    projection = {} if not placed else {"proj:epsg": 4326, "proj:shape": found["shape"]}
    if place.get("form") == "affine":
        a, b, c, d, e, f = place["transform"]
        projection["proj:transform"] = [b, c, a, e, f, d]
    lineage = (
        f"{quantity} of {frame.filename} (SHA-256 {frame.sha256}) with version {calibration.version} of "
        f"{calibration.method} (SHA-256 {calibration.content_sha256}), {row.software['measurer']}"
    )
    uncertainty = {f"stilb:{name}": place[name] for name in ("u_centre_m", "u_corner_m") if name in place}
    return {
        "type": "Feature",
        "stac_version": STAC_VERSION,
        "stac_extensions": [_EXTENSION.format(name) for name in ("eo", "processing", "projection", "raster")],
        "id": row.id,
        "geometry": {"type": "Polygon", "coordinates": [ring]} if placed else None,
        **area,
        "properties": {
            **_describe_time(row, frame),
            "created": _format(row.created_at),
            "processing:lineage": lineage,
            "processing:software": {"stilb": str(row.software["stilb"])},
            **({"stilb:place": place["detail"]} if "detail" in place else {}),
            **uncertainty,
        },
        "links": [
            {"rel": "self", "href": f"{own}/stac.json", "type": "application/geo+json"},
            {"rel": "derived_from", "href": f"{base}/v1/frames/{frame.id}", "type": "application/json"},
            {"rel": "via", "href": f"{base}/v1/calibrations/{calibration.id}", "type": "application/json"},
        ],
        "assets": {
            "map": {
                "href": f"{own}/map.tif",
                "type": "image/tiff; application=geotiff" if placed else "image/tiff",
                "title": f"{quantity} of {frame.filename}",
                "roles": ["data"],
                **({"raster:bands": bands, "eo:bands": colours} if bands else {}),
                **projection,
            },
            "picture": {"href": f"{own}/map.png", "type": "image/png", "roles": ["overview"]},
        },
    }


def _describe_band(plane: dict[str, str], data_type: str, place: dict[str, Any]) -> dict[str, Any]:
    side = {"spatial_resolution": place["pixel_m"]} if "pixel_m" in place else {}
    unit = {"unit": plane["UNITTYPE"], "nodata": "nan", "sampling": "area", "scale": 1, "offset": 0}
    return {"data_type": data_type, **unit, **side}


def _describe_colour(plane: dict[str, str]) -> dict[str, Any]:
    """Return the name of a plane, and its band's wavelength and width in the extension's um."""
    names = {"wavelength_nm": "center_wavelength", "width_nm": "full_width_half_max"}
    told = {name: float(plane[key]) / 1000.0 for key, name in names.items() if key in plane}
    return {"name": plane["DESCRIPTION"], **told}


def _describe_time(row: Measurement, frame: FrameRow) -> dict[str, Any]:
    """Return when the frame was taken; of a local time without its zone, when that can have been."""
    if (taken := read_frame_time(frame, Zones(campaign=row.parameters.get("time_zone")))) is None:
        return {"datetime": None, "start_datetime": _FIRST_DAY, "end_datetime": _format(frame.created_at)}
    if taken.is_known:
        return {"datetime": _format(taken.earliest)}
    return {
        "datetime": None,
        "start_datetime": _format(taken.earliest),
        "end_datetime": _format(taken.latest),
    }


def _format(at: datetime) -> str:
    return at.astimezone(UTC).isoformat().replace("+00:00", "Z")


router = operations.Router(prefix="/v1", tags=["measurements"])


@router.get("/measurements/{measurement_id}/map.json", **answers.sends(maps.MapValuesAnswer, 500))
def get_measurement_map_values(
    measurement_id: lookup.Id,
    request: Request,
    caller: auth.Reader,
    context: UsesContext,
    asked: Annotated[maps.MapWindow, Query()],
) -> Response:
    """A window of the map: with step 1 the very values of map.tif, else the means of squares.

    With `layer` their relative expanded uncertainty in place of the values.
    """
    with maps.open_map(context, measurement_id, caller) as found:
        tag = found.tag(asked.tag)
        if (unchanged := answers.not_modified(request, tag)) is not None:
            return unchanged
        layout = found.layout
        window = _cut(layout, asked)
        values = maps.read_values(found.path, layout, window, step=asked.step)
        if asked.layer == "expanded_uncertainty_rel":
            values = maps.map_uncertainty(found, window, values, step=asked.step)
        answer = maps.MapValuesAnswer.of(found.row, layout, window, values, asked, notes=found.list_notes())
    return answer.respond(answers.immutable_headers(tag))


@router.get(
    "/measurements/{measurement_id}/stac.json",
    response_class=lists.GeoJson,
    **answers.sends(maps.StacItem, 500),
)
def get_measurement_stac(
    measurement_id: lookup.Id, request: Request, caller: auth.Reader, context: UsesContext
) -> Response:
    """Return the map as a STAC item, with the extensions eo, processing, projection and raster.

    Its geometry is null where the map is not placed. A local time without a zone becomes the interval that
    it lies in.
    """
    with context.database.reading() as session:
        row = lookup.owned(session, Measurement, measurement_id, caller)
    sha256 = maps.require_map(row.map_tif_sha256)
    base = connections.absolute(request, "")
    tag = hashlib.sha256(f"{sha256}-{row.id}-{base}".encode()).hexdigest()
    if (unchanged := answers.not_modified(request, tag)) is not None:
        return unchanged
    with context.files.local(sha256) as file:
        prove_file(file)
        found = describe_map(file.path)
    with context.database.reading() as session:
        frame = session.get_one(FrameRow, row.frame_id)
        calibration = session.get_one(Calibration, row.calibration_id)
        item = make_item(row, frame, calibration, found, base=base)
    return lists.GeoJson(item, headers=answers.immutable_headers(tag))


def _cut(layout: maps.Layout, asked: maps.MapWindow) -> maps.Window:
    bottom = min(layout.height_px, asked.top + (asked.height or layout.height_px))
    right = min(layout.width_px, asked.left + (asked.width or layout.width_px))
    rows, cols = (bottom - asked.top) // asked.step, (right - asked.left) // asked.step
    if rows < 1 or cols < 1:
        size = f"{layout.height_px} rows and {layout.width_px} columns"
        raise problems.wrong("query.top", f"the map has {size}: the window holds no whole square of it")
    if rows * cols > maps.MOST_VALUES:
        message = f"{rows * cols} values at once are too many: take a larger step, or a smaller window"
        raise problems.wrong("query.step", message)
    return maps.Window(top=asked.top, left=asked.left, bottom=bottom, right=right)
