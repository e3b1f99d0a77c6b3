"""A band's reflectance: its region and its map; or an index of two bands of one capture."""

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from radiometry.frame import Frame, FrameHeader
from radiometry.frame.roi import Polygon, bounding_window
from radiometry.specification.application import BandApplication
from store.applied import read_applied
from store.codec import decode_header, encode
from store.measuring.record import Products
from store.software import read_version
from worker.maps.making import Made, Subject, make_map
from worker.maps.packet import write_packet
from worker.maps.picture import REFLECTANCE, Style
from worker.maps.strips import cut_strips
from worker.maps.tiff import MapFacts, Plane
from worker.measuring.task import Task, keep, keep_file

_INDEX_ENDS = (-1.0, 1.0)


def measure(task: Task, application: BandApplication) -> tuple[dict[str, Any], Products | None]:
    """The result as it is stored, and the map where one was asked for."""
    if "index" in task.parameters:
        return _measure_index(task, application)
    pixels = _read_region(task)
    measured = application.measure_region(
        pixels,
        _region(task),
        header=task.header,
        exposure=task.exposure,
        coefficients=read_applied(task.calibration),
        incidence_angle_deg=_angle(task),
    )
    task.report(0.1)
    result: dict[str, Any] = encode(measured)
    if not task.wants_map:
        return result, None
    made, products = _map_band(task, application)
    total = task.header.height_px * task.header.width_px
    counts = {"pixels": total, "below_zero": made.below_zero, "above_one": made.above_one}
    return result | {"map": counts | {"saturated": made.unknown}}, products


def _angle(task: Task) -> float | None:
    """The angle that the measurement states; None for that of the fit."""
    stated = task.parameters.get("incidence_angle_deg")
    return None if stated is None else float(stated)


def _region(task: Task) -> Polygon:
    return Polygon.from_points(task.parameters["polygon"])


def _read_region(task: Task) -> Frame:
    header = task.header
    window = bounding_window(_region(task), height_px=header.height_px, width_px=header.width_px)
    return task.decoders.read_window(task.file, (window.row0, window.col0, window.height, window.width))


def _map_band(task: Task, application: BandApplication) -> tuple[Made, Products]:
    header, exposure = task.header, task.exposure
    scale = application.find_scale_of_frame(
        header, coefficients=read_applied(task.calibration), incidence_angle_deg=_angle(task)
    )

    def compute(frame: Frame) -> Plane:
        made: Plane = application.compute_map(
            frame, header=header, exposure=exposure, scale=scale
        ).reflectance
        return made

    subject = Subject(
        file=task.file,
        header=header,
        compute=compute,
        counts=True,
        report=lambda share: task.report(0.1 + 0.9 * share),
    )
    assert header.multispectral is not None  # noqa: S101  the plan refused files without one
    packet = write_packet(header.attitude, header.multispectral)
    description = _describe(task, header, quantity=application.quantity)
    return _draw(task, subject, header, REFLECTANCE, description, packet)


def _describe(task: Task, header: FrameHeader, **more: Any) -> dict[str, Any]:  # noqa: ANN401
    band = header.multispectral
    assert band is not None  # noqa: S101  the plan refused files without one
    said = {
        "band": band.band_name,
        "wavelength_nm": band.wavelength_nm,
        "width_nm": band.width_nm,
        "capture_id": band.capture_id,
    }
    known = {name: value for name, value in said.items() if value is not None}
    angle_deg = _angle(task)
    if angle_deg is None:
        angle_deg = read_applied(task.calibration)[0].incidence_angle_deg
    return task.describe(**more, unit="1", saturated="NaN", incidence_angle_deg=angle_deg, **known)


def _draw(
    task: Task,
    subject: Subject,
    header: FrameHeader,
    style: Style,
    description: dict[str, Any],
    packet: bytes,
) -> tuple[Made, Products]:
    facts = MapFacts(
        header=header,
        exposure=task.exposure,
        software=f"stilb {read_version()}",
        description=description,
        packet=packet,
    )
    with tempfile.TemporaryDirectory(prefix="stilb-map-") as folder:
        target = Path(folder) / "map.tif"
        made = make_map(
            task.decoders,
            subject,
            facts,
            target,
            style=style,
            caption=f"{task.frame.filename}, calibration version {task.calibration.version}",
        )
        blobs = task.blobs
        return made, Products(tif=keep_file(blobs, target), png=keep(blobs, made.picture))


def _measure_index(task: Task, application: BandApplication) -> tuple[dict[str, Any], Products | None]:
    """``task.frame`` shows the near infrared; the plan names the other band's frame."""
    index, named = task.parameters["index"], task.parameters["other"]
    with task.lend(named["frame_id"]) as (row, file), task.decoders.hold(file):
        other = replace(
            task,
            frame=row,
            header=decode_header(row.header or {}),
            file=file,
            parameters=task.parameters | {"polygon": named["polygon"]},
        )
        result: dict[str, Any] = encode(
            application.measure_index(index, _apply(task, application), _apply(other, application))
        )
        task.report(0.1)
        if not task.wants_map:
            return result, None
        names = application.name_bands(index)
        bands = {name: _whole(each, application) for name, each in zip(names, (task, other), strict=True)}
    found = application.compute_index(index, bands)
    task.report(0.6)
    values = found.values
    subject = Subject(
        file=task.file,
        header=task.header,
        compute=lambda frame: values[frame.row0 : frame.row0 + frame.samples_dn.shape[0]],
        report=lambda share: task.report(0.6 + 0.4 * share),
    )
    style = Style(unit=index.upper(), unknown="none", ends=_INDEX_ENDS)
    description = _describe(task, task.header, quantity=index, other=named)
    # of two bands: neither's name is the map's
    packet = write_packet(task.header.attitude)
    _, products = _draw(task, subject, task.header, style, description, packet)
    counts = {"pixels": int(values.size), "undefined": found.undefined}
    return result | {"map": counts}, products


def _apply(task: Task, application: BandApplication) -> Any:  # noqa: ANN401  the method's own
    features = application.extract_features(
        _read_region(task), _region(task), header=task.header, exposure=task.exposure
    )
    return application.apply(
        features,
        header=task.header,
        coefficients=read_applied(task.calibration),
        incidence_angle_deg=_angle(task),
    )


def _whole(task: Task, application: BandApplication) -> Any:  # noqa: ANN401  the method's own
    """The reflectance of a whole frame, strip by strip into one array."""
    header, exposure = task.header, task.exposure
    scale = application.find_scale_of_frame(
        header, coefficients=read_applied(task.calibration), incidence_angle_deg=_angle(task)
    )
    plane = np.empty((header.height_px, header.width_px), np.float32)
    for top, height in cut_strips(header):
        frame = task.decoders.read_window(task.file, (top, 0, height, header.width_px))
        computed = application.compute_map(frame, header=header, exposure=exposure, scale=scale)
        plane[top : top + height] = computed.reflectance
    return application.band_map(header=header, reflectance=plane)
