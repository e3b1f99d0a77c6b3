"""Measurement of a lit surface in a frame, and the picture of one without the lens's distortion."""

import io
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from radiometry.drawing.chart import WIDEST_PX
from radiometry.frame import Frame, FrameHeader
from radiometry.methods import get_method
from radiometry.specification.application import PictureApplication, SurfaceApplication
from store.codec import decode_exposure, encode, read_applied
from store.measuring import plan, version
from store.measuring.record import Products, read_regions
from worker.decode.pool import Readable
from worker.maps import making, packet, picture, tiff
from worker.measuring.task import Task


def measure_surface(task: Task, application: SurfaceApplication) -> tuple[dict[str, Any], Products | None]:
    measured = measure_region(task, application)
    task.report(0.2)
    return encode(measured), _map(task, application, measured) if task.wants_map else None


def make_subject(
    application: SurfaceApplication,
    file: Readable,
    header: FrameHeader,
    scale: Any,  # noqa: ANN401  the method's own
) -> making.Subject:
    return making.Subject(
        file=file,
        header=header,
        compute=lambda frame: application.compute_map(frame, scale),
        rim_px=application.rim_px,
    )


def measure_region(task: Task, application: SurfaceApplication) -> Any:  # noqa: ANN401  the method's own
    request, header = plan.read_request(application, task.parameters), task.header
    window = application.find_window(request, height_px=header.height_px, width_px=header.width_px)
    decoders, part = task.decoders, (window.row0, window.col0, window.height, window.width)
    lens, falloff = version.read_lens(task.calibration, task.exposure), _find_correction(task)
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
    lens = version.read_lens(task.calibration, task.exposure)
    scale = application.find_map_scale(
        read_applied(task.calibration), task.exposure, lens=lens, corrections=measured.corrections
    )
    facts = tiff.MapFacts(
        header=task.header,
        exposure=task.exposure,
        description=task.describe(
            quantity=application.quantity,
            unit=application.unit,
            saturated="NaN",
            signal=scale.channel,
            vignetting=_find_correction(task) or "none",
            corrections=[encode(each) for each in measured.corrections],
        ),
        packet=packet.write_packet(task.header),
        layers=(tiff.Layer(name=application.quantity, unit=application.unit),),
    )
    subject, more = make_subject(application, task.file, task.header, scale), ""
    if "repeats" in task.parameters:
        more = f" and {len(task.parameters['repeats'])} more"
        repeats = (make_subject(application, file, task.header, scale) for file in task.open_repeats())
        subject = making.average_maps(task.decoders, subject, repeats)
    _, products = task.make_products(
        lambda target: making.make_map(
            task.decoders, subject, facts, target, style=picture.LUMINANCE, caption=task.caption(more)
        )
    )
    return products


_DARK_PERCENTILE, _BRIGHT_PERCENTILE = 0.5, 99.5
_GAMMA = 1 / 2.2


def undistort_picture(task: Task, application: PictureApplication) -> tuple[dict[str, Any], Products]:
    """The camera that was used, and the picture as TIFF and as a preview."""
    header = task.header
    found = application.undistort_frame(_read(task), read_applied(task.calibration))
    task.report(0.7)
    parameters = {
        row["name"]: {name: row[name] for name in ("value", "standard_uncertainty", "unit")}
        for row in task.calibration.result["coefficients"]
        if row["name"] != "rms_px"
    }
    undistorted = {
        "planes": list(found.planes),
        "linear": not header.rendered,
        "height_px": header.height_px,
        "width_px": header.width_px,
        "seen_share": found.seen_share,
        "parameters": parameters,
    }
    description = task.describe(
        quantity=application.quantity,
        unit=application.unit,
        unseen=0,
        black_level_dn=list(header.black_level_dn),
        white_level_dn=list(header.white_level_dn),
        **undistorted,
    )
    facts = tiff.MapFacts(
        header=header,
        exposure=decode_exposure(task.frame.exposure) if task.frame.exposure else None,
        description=description,
        packet=packet.write_packet(header),
    )

    def write(target: Path) -> making.Made:
        tiff.write_picture(target, found.samples_dn, facts)
        return making.Made(picture=draw_preview(found.samples_dn, linear=not header.rendered))

    return {"undistorted": undistorted, "flags": []}, task.make_products(write)[1]


def _read(task: Task) -> Frame:
    """The whole frame, strip by strip: a decoder is asked for no more at once."""
    frames = [
        task.decoders.read_window(task.file, (top, 0, height, task.header.width_px))
        for top, height in making.cut_strips(task.header)
    ]
    return replace(frames[0], samples_dn=np.concatenate([frame.samples_dn for frame in frames]))


def draw_preview(samples_dn: tiff.Samples, *, linear: bool) -> bytes:
    """PNG of 8 bits: every n-th pixel, straight between two percentiles; linear numbers get a tone curve."""
    step = max(1, -(-max(samples_dn.shape[:2]) // WIDEST_PX))
    shown: NDArray[np.float64] = samples_dn[::step, ::step].astype(np.float64)
    low, high = np.percentile(shown, (_DARK_PERCENTILE, _BRIGHT_PERCENTILE))
    share = np.clip((shown - low) / max(high - low, 1.0), 0.0, 1.0)
    pixels = np.round(255 * (share**_GAMMA if linear else share)).astype(np.uint8)
    out = io.BytesIO()
    Image.fromarray(pixels).save(out, "PNG", compress_level=1)
    return out.getvalue()
