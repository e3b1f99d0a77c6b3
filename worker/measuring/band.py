"""A band's reflectance or radiance: its region and its map."""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from radiometry.frame import Frame
from radiometry.frame.place import Place
from radiometry.frame.roi import Polygon, bounding_window
from radiometry.specification.application import BandApplication
from store.codec import decode, drop_absent, encode, read_applied
from store.measuring.record import Products
from store.software import read_version
from worker.maps.making import Made, Subject, draw_map, make_map
from worker.maps.packet import write_packet
from worker.maps.picture import REFLECTANCE, Style
from worker.maps.strips import cut_strips
from worker.maps.tiff import Layer, MapFacts, Plane
from worker.measuring.task import Task, keep, keep_file


def measure(task: Task, application: BandApplication) -> tuple[dict[str, Any], Products | None]:
    """Return the result as it is stored, and the map if one was asked for."""
    pixels = _read_region(task)
    if _is_radiance(task, application):
        measured = application.measure_radiance(
            pixels, _region(task), header=task.header, exposure=task.exposure
        )
    else:
        measured = application.measure_region(
            pixels,
            _region(task),
            header=task.header,
            exposure=task.exposure,
            coefficients=read_applied(task.calibration),
            incidence_angle_deg=read_angle(task),
        )
    task.report(0.1)
    result: dict[str, Any] = encode(measured) | {"place": tell_place(task, application)}
    if not task.wants_map:
        return result, None
    made, products = _map_band(task, application)
    total = task.header.height_px * task.header.width_px
    counts = {"pixels": total, "below_zero": made.below_zero, "above_one": made.above_one}
    return result | {"map": counts | {"saturated": made.unknown}}, products


def read_angle(task: Task) -> float | None:
    """Return the angle that the measurement states; None for that of the fit."""
    stated = task.parameters.get("incidence_angle_deg")
    return None if stated is None else float(stated)


def find_place(task: Task, application: BandApplication) -> Place:
    """Return where the pixels of the task's frame lie."""
    place: Place = application.find_place(
        task.header, decode(application.conditions, task.parameters.get("conditions", {}))
    )
    return place


def tell_place(task: Task, application: BandApplication) -> dict[str, Any]:
    """Return the place as results and maps' descriptions keep it; tie points are in the map's tags."""
    told: dict[str, Any] = drop_absent(encode(find_place(task, application)))
    return {name: value for name, value in told.items() if name != "tie_points"}


def _is_radiance(task: Task, application: BandApplication) -> bool:
    return bool(task.parameters.get("quantity", application.quantity) != application.quantity)


def _region(task: Task) -> Polygon:
    return Polygon.from_points(task.parameters["polygon"])


def _read_region(task: Task) -> Frame:
    header = task.header
    window = bounding_window(_region(task), height_px=header.height_px, width_px=header.width_px)
    return task.decoders.read_window(task.file, (window.row0, window.col0, window.height, window.width))


def _find_factor(task: Task, application: BandApplication) -> float:
    """Return the factor from the signal to the quantity of the map."""
    if _is_radiance(task, application):
        application.require_radiance(task.header)
        return 1.0
    scale = application.find_scale_of_frame(
        task.header, coefficients=read_applied(task.calibration), incidence_angle_deg=read_angle(task)
    )
    return float(scale.factor)


def _map_band(task: Task, application: BandApplication) -> tuple[Made, Products]:
    header, exposure, factor = task.header, task.exposure, _find_factor(task, application)
    radiance, band = _is_radiance(task, application), header.multispectral
    assert band is not None  # noqa: S101  the plan refused files without one
    unit = application.radiance_unit if radiance else application.unit
    said = {"wavelength_nm": band.wavelength_nm, "width_nm": band.width_nm}
    facts = MapFacts(
        header=header,
        exposure=exposure,
        software=f"stilb {read_version()}",
        description=describe(
            task, application, quantity="radiance" if radiance else application.quantity, unit=unit
        ),
        place=find_place(task, application),
        packet=write_packet(header, [band]),
        layers=(
            Layer(
                name=band.band_name,
                unit=unit,
                said={name: value for name, value in said.items() if value is not None},
            ),
        ),
    )

    def compute(frame: Frame) -> Plane:
        made: Plane = application.scale_pixels(frame, header=header, exposure=exposure, factor=factor)
        return made

    subject = Subject(
        file=task.file,
        header=header,
        compute=compute,
        counts=True,
        report=lambda share: task.report(0.1 + 0.9 * share),
    )
    style = Style(unit=unit) if radiance else REFLECTANCE
    with tempfile.TemporaryDirectory(prefix="stilb-map-") as folder:
        target = Path(folder) / "map.tif"
        made = make_map(task.decoders, subject, facts, target, style=style, caption=_caption(task))
        return made, Products(tif=keep_file(task.blobs, target), png=keep(task.blobs, made.picture))


def _caption(task: Task) -> str:
    return f"{task.frame.filename}, calibration version {task.calibration.version}"


def describe(task: Task, application: BandApplication, **more: Any) -> dict[str, Any]:  # noqa: ANN401
    """Return what ImageDescription says of a map of a band, or of an index on its pixels."""
    band = task.header.multispectral
    assert band is not None  # noqa: S101  the plan refused files without one
    said = {
        "band": band.band_name,
        "wavelength_nm": band.wavelength_nm,
        "width_nm": band.width_nm,
        "capture_id": band.capture_id,
    }
    known = {name: value for name, value in said.items() if value is not None}
    angle_deg = read_angle(task)
    if angle_deg is None:
        angle_deg = read_applied(task.calibration)[0].incidence_angle_deg
    place = tell_place(task, application)
    return task.describe(**more, saturated="NaN", incidence_angle_deg=angle_deg, place=place, **known)


def draw_planes(
    task: Task,
    application: BandApplication,
    planes: Sequence[Plane],
    layers: Sequence[Layer],
    style: Style,
    description: dict[str, Any],
    *,
    packet: bytes,
    counts: bool = False,
) -> tuple[Made, Products]:
    """Write planes on the pixels of the task's band as one file, and draw the first."""
    facts = MapFacts(
        header=task.header,
        exposure=task.exposure,
        software=f"stilb {read_version()}",
        description=description,
        packet=packet,
        layers=tuple(layers),
        place=find_place(task, application),
    )
    with tempfile.TemporaryDirectory(prefix="stilb-map-") as folder:
        target = Path(folder) / "map.tif"
        made = draw_map(planes, facts, target, style=style, caption=_caption(task), counts=counts)
        return made, Products(tif=keep_file(task.blobs, target), png=keep(task.blobs, made.picture))


def apply_version(task: Task, application: BandApplication) -> Any:  # noqa: ANN401  the method's own
    """Return the reflectance of the task's region."""
    features = application.extract_features(
        _read_region(task), _region(task), header=task.header, exposure=task.exposure
    )
    return application.apply(
        features,
        header=task.header,
        coefficients=read_applied(task.calibration),
        incidence_angle_deg=read_angle(task),
    )


def read_plane(task: Task, application: BandApplication) -> Plane:
    """Return the reflectance or radiance of a whole frame, read strip by strip into one array."""
    header, exposure, factor = task.header, task.exposure, _find_factor(task, application)
    plane = np.empty((header.height_px, header.width_px), np.float32)
    for top, height in cut_strips(header):
        frame = task.decoders.read_window(task.file, (top, 0, height, header.width_px))
        plane[top : top + height] = application.scale_pixels(
            frame, header=header, exposure=exposure, factor=factor
        )
    return plane
