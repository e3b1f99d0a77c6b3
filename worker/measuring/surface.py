"""Measurement of a lit surface in a frame: its region, its grid, its map."""

import tempfile
from pathlib import Path
from typing import Any

from radiometry.frame import FrameHeader
from radiometry.methods import get_method
from radiometry.specification.application import SurfaceApplication
from store.codec import encode, read_applied
from store.measuring.plan import read_request
from store.measuring.record import Products, read_regions
from store.measuring.version import read_lens
from store.software import read_version
from worker.decode.pool import Readable
from worker.maps.making import Subject, average_maps, make_map
from worker.maps.packet import write_packet
from worker.maps.picture import LUMINANCE
from worker.maps.tiff import Layer, MapFacts
from worker.measuring.task import Task, keep, keep_file


def measure(task: Task, application: SurfaceApplication) -> tuple[dict[str, Any], Products | None]:
    measured = _measure(task, application)
    task.report(0.2)
    return encode(measured), _map(task, application, measured) if task.wants_map else None


def make_subject(
    application: SurfaceApplication,
    file: Readable,
    header: FrameHeader,
    scale: Any,  # noqa: ANN401  the method's own
) -> Subject:
    """Return the frame as the subject of a map of one scale."""
    return Subject(
        file=file,
        header=header,
        compute=lambda frame: application.compute_map(frame, scale),
        rim_px=application.rim_px,
    )


def _measure(task: Task, application: SurfaceApplication) -> Any:  # noqa: ANN401  the method's own
    request, header = read_request(application, task.parameters), task.header
    window = application.find_window(request, height_px=header.height_px, width_px=header.width_px)
    decoders, part = task.decoders, (window.row0, window.col0, window.height, window.width)
    lens, falloff = read_lens(task.calibration, task.exposure), _find_correction(task)
    return application.measure(
        decoders.read_window(task.file, part),
        request,
        exposure=task.exposure,
        coefficients=read_applied(task.calibration),
        calibrated=read_regions(task.calibration),
        correction=application.correction(name=falloff["calibration_id"], lens=lens)
        if lens and falloff
        else None,
        rendered=header.rendered,
        repeats=(decoders.read_window(file, part) for file in task.open_repeats()),
    )


def _find_correction(task: Task) -> Any:  # noqa: ANN401  as the plan names it
    """Return the version that corrects the frame, as the plan names it, None if there is none."""
    corrector = get_method(task.calibration.method).corrected_by
    return task.parameters.get(corrector) if corrector else None


def _map(task: Task, application: SurfaceApplication, measured: Any) -> Products:  # noqa: ANN401
    lens = read_lens(task.calibration, task.exposure)
    scale = application.find_map_scale(
        read_applied(task.calibration), task.exposure, lens=lens, corrections=measured.corrections
    )
    facts = MapFacts(
        header=task.header,
        exposure=task.exposure,
        software=f"stilb {read_version()}",
        description=task.describe(
            quantity=application.quantity,
            unit=application.unit,
            saturated="NaN",
            signal=scale.channel,
            vignetting=_find_correction(task) or "none",
            corrections=[encode(each) for each in measured.corrections],
        ),
        packet=write_packet(task.header),
        layers=(Layer(name=application.quantity, unit=application.unit),),
    )
    subject, more = make_subject(application, task.file, task.header, scale), ""
    if "repeats" in task.parameters:
        more = f" and {len(task.parameters['repeats'])} more"
        repeats = (make_subject(application, file, task.header, scale) for file in task.open_repeats())
        subject = average_maps(task.decoders, subject, repeats)
    with tempfile.TemporaryDirectory(prefix="stilb-map-") as folder:
        target = Path(folder) / "map.tif"
        made = make_map(
            task.decoders,
            subject,
            facts,
            target,
            style=LUMINANCE,
            caption=f"{task.frame.filename}{more}, calibration version {task.calibration.version}",
        )
        blobs = task.blobs
        return Products(tif=keep_file(blobs, target), png=keep(blobs, made.picture))
