"""Reflectance or radiance of a band, and of the bands of one capture on the pixels of the first."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from radiometry.frame import Frame, roi
from radiometry.frame.place import Place
from radiometry.specification.application import BandApplication
from store.codec import decode, drop_absent, encode, read_applied
from store.measuring import plan, record
from worker.maps.making import Made, Subject, cut_strips, draw_map, make_map
from worker.maps.packet import write_packet
from worker.maps.picture import REFLECTANCE, Style
from worker.maps.tiff import Layer, MapFacts, Plane
from worker.measuring.task import Task


def measure_band(task: Task, application: BandApplication) -> tuple[dict[str, Any], record.Products | None]:
    """Return the result as it is stored, and the map if one was asked for."""
    pixels, region = _read_region(task), _region(task)
    if _is_radiance(task, application):
        measured = application.measure_radiance(pixels, region, header=task.header, exposure=task.exposure)
    else:
        measured = application.measure_region(
            pixels, region, header=task.header, exposure=task.exposure, **_fitted(task)
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


def _fitted(task: Task) -> dict[str, Any]:
    return {"coefficients": read_applied(task.calibration), "incidence_angle_deg": read_angle(task)}


def find_place(task: Task, application: BandApplication) -> Place:
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


def _region(task: Task) -> roi.Polygon:
    return roi.Polygon.from_points(task.parameters["polygon"])


def _read_region(task: Task) -> Frame:
    header = task.header
    window = roi.bounding_window(_region(task), height_px=header.height_px, width_px=header.width_px)
    return task.decoders.read_window(task.file, (window.row0, window.col0, window.height, window.width))


def _find_factor(task: Task, application: BandApplication) -> float:
    if _is_radiance(task, application):
        application.require_radiance(task.header)
        return 1.0
    return float(application.find_scale_of_frame(task.header, **_fitted(task)).factor)


def _map_band(task: Task, application: BandApplication) -> tuple[Made, record.Products]:
    header, exposure, factor = task.header, task.exposure, _find_factor(task, application)
    radiance, band = _is_radiance(task, application), task.band
    unit = application.radiance_unit if radiance else application.unit
    facts = MapFacts(
        header=header,
        exposure=exposure,
        description=describe(
            task, application, quantity="radiance" if radiance else application.quantity, unit=unit
        ),
        place=find_place(task, application),
        packet=write_packet(header, [band]),
        layers=(
            Layer(
                name=band.band_name,
                unit=unit,
                said=drop_absent({"wavelength_nm": band.wavelength_nm, "width_nm": band.width_nm}),
            ),
        ),
    )
    subject = Subject(
        file=task.file,
        header=header,
        compute=partial(application.scale_pixels, header=header, exposure=exposure, factor=factor),
        counts=True,
        report=lambda share: task.report(0.1 + 0.9 * share),
    )
    style = Style(unit=unit) if radiance else REFLECTANCE
    return task.make_products(
        lambda target: make_map(task.decoders, subject, facts, target, style=style, caption=task.caption())
    )


def describe(task: Task, application: BandApplication, **more: Any) -> dict[str, Any]:  # noqa: ANN401
    """Return what ImageDescription says of a map of a band, or of an index on its pixels."""
    band = task.band
    known = {"wavelength_nm": band.wavelength_nm, "width_nm": band.width_nm, "capture_id": band.capture_id}
    if (angle_deg := read_angle(task)) is None:
        angle_deg = read_applied(task.calibration)[0].incidence_angle_deg
    place = tell_place(task, application)
    more |= {"saturated": "NaN", "incidence_angle_deg": angle_deg, "place": place}
    return task.describe(**more, band=band.band_name, **drop_absent(known))


def draw_planes(
    task: Task,
    application: BandApplication,
    planes: Sequence[Plane],
    layers: Sequence[Layer],
    style: Style,
    said: dict[str, Any],
    *,
    packet: bytes,
    counts: bool = False,
) -> tuple[Made, record.Products]:
    """Write planes on the pixels of the task's band as one file, and draw the first."""
    facts = MapFacts(
        header=task.header,
        exposure=task.exposure,
        description=describe(task, application, **said),
        packet=packet,
        layers=tuple(layers),
        place=find_place(task, application),
    )
    return task.make_products(
        lambda target: draw_map(planes, facts, target, style=style, caption=task.caption(), counts=counts)
    )


def apply_version(task: Task, application: BandApplication) -> Any:  # noqa: ANN401  the method's own
    pixels, region = _read_region(task), _region(task)
    features = application.extract_features(pixels, region, header=task.header, exposure=task.exposure)
    return application.apply(features, header=task.header, **_fitted(task))


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


_INDEX_ENDS = (-1.0, 1.0)


@dataclass(frozen=True, kw_only=True)
class Capture:
    """The tasks of a capture's bands, the measurement's own first, and their planes on its pixels."""

    tasks: dict[str, Task]
    planes: dict[str, Plane]
    alignment: tuple[Any, ...]


@contextmanager
def open_capture(task: Task, application: BandApplication) -> Iterator[Capture]:
    """Read the bands that the plan names whole, and align them onto the task's own."""
    with ExitStack() as stack:
        tasks = {task.band.band: task}
        for named in plan.list_others(task.parameters):
            row, file = stack.enter_context(task.lend(named["frame_id"]))
            stack.enter_context(task.decoders.hold(file))
            other = replace(task, frame=row, file=file)
            tasks[other.band.band] = other
        whole = {}
        for number, (band, each) in enumerate(tasks.items(), start=1):
            plane = read_plane(each, application)
            whole[band] = application.band_map(header=each.header, reflectance=plane)
            task.report(0.5 * number / len(tasks))
        first, *others = whole
        aligned = {band: application.align_band(whole[band], whole[first]) for band in others}
        planes = {first: whole[first].reflectance}
        planes |= {band: found.reflectance for band, found in aligned.items()}
        yield Capture(
            tasks=tasks, planes=planes, alignment=tuple(found.alignment for found in aligned.values())
        )


def measure_index(task: Task, application: BandApplication) -> tuple[dict[str, Any], record.Products | None]:
    """Measure an index of the region, whose polygon each band has at its own place."""
    formula = application.read_formula(task.parameters["index"])
    coefficients = read_applied(task.calibration)
    with open_capture(task, application) as capture:
        placed = _place_region(capture, application)
        applied = [apply_version(each, application) for each in placed]
        displaced = {
            each.band: application.displace_region(
                capture.planes[each.band],
                roi.Polygon.from_points(placed[0].parameters["polygon"]),
                residual_px=each.residual_px,
            )
            for each in capture.alignment
        }
        measured = application.measure_index(
            formula, applied, coefficients=coefficients, alignment=capture.alignment, displaced=displaced
        )
        result: dict[str, Any] = encode(measured) | {"place": tell_place(task, application)}
        task.report(0.6)
        if not task.parameters["products"]:
            return result, None
        found = application.compute_index(formula, capture.planes)
        said: dict[str, Any] = {"quantity": formula.name, "formula": formula.text, "unit": "1"}
        layers = [Layer(name=formula.name, unit="1", said={"formula": formula.text})]
        planes = [found.values]
        if task.wants_bands:
            u = application.map_uncertainty(
                formula, capture.planes, applied, coefficients=coefficients, alignment=capture.alignment
            )
            layers += [Layer(name=f"u({formula.name})", unit="1"), *_list_layers(capture, application)]
            planes += [u, *capture.planes.values()]
    named = formula.name.upper() if formula.name != formula.text else "index"
    style = Style(unit=named, unknown="none", ends=_INDEX_ENDS)
    budget = {share.source: share.standard_uncertainty for share in measured.budget}
    said["uncertainty"] = {"region_mean": encode(measured.value), "budget": budget}
    said |= _describe_capture(capture)
    # of several bands: without them no band's name is the map's
    packet = _write_packet(capture) if task.wants_bands else write_packet(task.header)
    _, products = draw_planes(task, application, planes, layers, style, said, packet=packet)
    return result | {"map": {"pixels": int(found.values.size), "undefined": found.undefined}}, products


def write_bands(
    task: Task, application: BandApplication, result: dict[str, Any]
) -> tuple[dict[str, Any], record.Products]:
    """Write all bands of the task's capture on its pixels, as reflectance or radiance."""
    with open_capture(task, application) as capture:
        layers, planes = _list_layers(capture, application), list(capture.planes.values())
        flags = encode(application.flag_alignment(capture.alignment))
        quantity = task.parameters.get("quantity", application.quantity)
        said = {"quantity": quantity, "unit": layers[0].unit} | _describe_capture(capture)
        style = REFLECTANCE if quantity == application.quantity else Style(unit=layers[0].unit)
        packet = _write_packet(capture)
        made, products = draw_planes(
            task, application, planes, layers, style, said, packet=packet, counts=True
        )
    counts = {"pixels": int(planes[0].size), "below_zero": made.below_zero, "above_one": made.above_one}
    return {
        **result,
        "flags": [*result["flags"], *flags],
        "alignment": encode(capture.alignment),
        "map": counts | {"saturated": made.unknown},
    }, products


def _place_region(capture: Capture, application: BandApplication) -> list[Task]:
    first, *others = capture.tasks.values()
    matrices = [each.matrix for each in capture.alignment]
    pairs = [(each.header, matrix) for each, matrix in zip(others, matrices, strict=True)]
    region = roi.Polygon.from_points(first.parameters["polygon"])
    regions = application.move_regions(region, first.header, pairs)
    return [_move(each, polygon.points) for each, polygon in zip((first, *others), regions, strict=True)]


def _move(task: Task, points: Any) -> Task:  # noqa: ANN401  pairs of numbers
    return replace(task, parameters=task.parameters | {"polygon": [list(point) for point in points]})


def _write_packet(capture: Capture) -> bytes:
    headers = [task.header for task in capture.tasks.values()]
    return write_packet(headers[0], [band for each in headers if (band := each.multispectral) is not None])


def _list_layers(capture: Capture, application: BandApplication) -> list[Layer]:
    layers = []
    left = {each.band: each for each in capture.alignment}
    for band, task in capture.tasks.items():
        found, radiance = task.band, _is_radiance(task, application)
        said: dict[str, Any] = {"band": band, "frame_sha256": task.frame.sha256}
        said |= drop_absent({"wavelength_nm": found.wavelength_nm, "width_nm": found.width_nm})
        if band in left:
            said |= {"alignment": left[band].by, "alignment_residual_px": round(left[band].residual_px, 3)}
        if not radiance:
            scale = application.find_scale_of_frame(task.header, **_fitted(task))
            said |= {"reflectance_k": scale.reflectance_k, "u_rel": round(scale.u_rel, 6)}
        unit = application.radiance_unit if radiance else application.unit
        layers.append(Layer(name=found.band_name, unit=unit, said=said))
    return layers


def _describe_capture(capture: Capture) -> dict[str, Any]:
    frames = {
        band: {"id": task.frame.id, "sha256": task.frame.sha256, "filename": task.frame.filename}
        for band, task in capture.tasks.items()
    }
    return {"frames": frames, "alignment": encode(capture.alignment)}
