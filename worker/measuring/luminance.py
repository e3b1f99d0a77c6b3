"""A frame's luminance: its region, its grid, its map."""

import tempfile
from pathlib import Path
from typing import Any

from radiometry.frame import FrameHeader
from radiometry.luminance import measurement
from radiometry.luminance.maps import RIM_PX, MapScale, compute_map, find_map_scale
from radiometry.luminance.measured import Measured
from store.codec import encode
from store.falloff import read_lens
from store.measuring.plan import read_request
from store.measuring.record import Products, read_coefficients, read_regions
from store.software import read_version
from worker.decode.pool import Readable
from worker.maps.making import Subject, make_map
from worker.maps.packet import write_packet
from worker.maps.picture import LUMINANCE
from worker.maps.tiff import MapFacts
from worker.measuring.task import Task, keep, keep_file


def measure(task: Task) -> tuple[dict[str, Any], Products | None]:
    measured: dict[str, Any] = encode(_measure(task))
    task.report(0.2)
    return measured, _map(task) if task.wants_map else None


def make_subject(file: Readable, header: FrameHeader, scale: MapScale) -> Subject:
    """A frame whose map is its luminance."""
    return Subject(file=file, header=header, compute=lambda frame: compute_map(frame, scale), rim_px=RIM_PX)


def _measure(task: Task) -> Measured:
    request, header = read_request(task.parameters), task.header
    window = measurement.find_window(request, height_px=header.height_px, width_px=header.width_px)
    pixels = task.context.decoders.read_window(
        task.file, (window.row0, window.col0, window.height, window.width)
    )
    lens, falloff = read_lens(task.calibration, task.exposure), task.parameters.get("vignetting")
    return measurement.measure(
        pixels,
        request,
        exposure=task.exposure,
        coefficients=read_coefficients(task.calibration),
        calibrated=read_regions(task.calibration),
        correction=measurement.Vignetting(name=falloff["calibration_id"], lens=lens)
        if lens and falloff
        else None,
        rendered=header.rendered,
    )


def _map(task: Task) -> Products:
    lens = read_lens(task.calibration, task.exposure)
    scale = find_map_scale(read_coefficients(task.calibration), task.exposure, lens=lens)
    facts = MapFacts(
        header=task.header,
        exposure=task.exposure,
        software=f"stilb {read_version()}",
        description=task.describe(
            quantity="luminance",
            unit="cd/m2",
            saturated="NaN",
            signal=scale.channel,
            vignetting=task.parameters.get("vignetting", "none"),
        ),
        packet=write_packet(task.header.attitude),
    )
    with tempfile.TemporaryDirectory(prefix="stilb-map-") as folder:
        target = Path(folder) / "map.tif"
        made = make_map(
            task.context.decoders,
            make_subject(task.file, task.header, scale),
            facts,
            target,
            style=LUMINANCE,
            caption=f"{task.frame.filename}, calibration version {task.calibration.version}",
        )
        blobs = task.context.blobs
        return Products(tif=keep_file(blobs, target), png=keep(blobs, made.picture))
