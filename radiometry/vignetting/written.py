"""Exports of a vignetting version."""

import json
from typing import Any, Final

from radiometry.frame.lensfun import list_options, name_for_lensfun
from radiometry.specification.exports import Export, ExportOption, ExportSubject, Picture
from radiometry.vignetting.application import select_channels
from radiometry.vignetting.correction import compute_correction
from radiometry.vignetting.lensfun import export_lensfun
from radiometry.vignetting.residuals import read_residuals
from radiometry.vignetting.results import Fit

_F_NUMBER: Final = ExportOption(name="f_number", kind="number")
_CHANNEL: Final = ExportOption(name="channel", kind="text")


def _write_lensfun(fitted: Fit, subject: ExportSubject, options: dict[str, Any]) -> str:
    coefficients = fitted.coefficients
    first = coefficients[0]
    names = name_for_lensfun(subject, options, width_px=first.width_px, height_px=first.height_px)
    return export_lensfun(coefficients, channels=select_channels(coefficients, signal="green"), names=names)


def _write_correction(fitted: Fit, _: ExportSubject, options: dict[str, Any]) -> Picture:
    gains = compute_correction(fitted.coefficients, cfa=fitted.cfa, f_number=options["f_number"])
    return Picture(samples=gains)


def _write_residuals(fitted: Fit, subject: ExportSubject, options: dict[str, Any]) -> Picture:
    fit, residuals = read_residuals(fitted.channel_fits, **options)
    said = {
        "quantity": "(light - fitted) / fitted",
        "unit": "1",
        **options,
        "block_px": fit.block_px,
        "residual_rms_rel": fit.residual_rms_rel,
        "calibration_id": subject.calibration_id,
    }
    return Picture(samples=residuals, description=json.dumps(said))


EXPORTS: Final = (
    Export(
        filename="lensfun.xml",
        label="Lensfun",
        media_type="application/xml",
        operation="get_lensfun_xml",
        description="The falloff as an entry of Lensfun's database. The pixel pitch must be registered with "
        "the camera.",
        write=_write_lensfun,
        options=list_options(needs_widest=False),
        needs_pixel_pitch=True,
    ),
    Export(
        filename="correction.tif",
        label="Correction map",
        media_type="image/tiff",
        operation="get_correction_map",
        description="1 / V of every pixel, float32: multiply what lies above dark by it, each pixel by its "
        "own channel's.",
        write=_write_correction,
        options=(_F_NUMBER,),
    ),
    Export(
        filename="residuals.tif",
        label="Residual map",
        media_type="image/tiff",
        operation="get_residual_map",
        description="What the curve leaves of the flats, (light - fitted) / fitted, float32: a pixel for "
        "each block.\n\nNaN where a block did not count. The description says how many pixels of the frame a "
        "block is wide.",
        write=_write_residuals,
        options=(_F_NUMBER, _CHANNEL),
    ),
)
