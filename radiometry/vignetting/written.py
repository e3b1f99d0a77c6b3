"""Exports of a vignetting version."""

import base64
import json
from typing import Any, Final

from radiometry.frame.lensfun import list_options, name_for_lensfun
from radiometry.specification.exports import Export, ExportOption, ExportSubject, Picture
from radiometry.vignetting.application import select_channels
from radiometry.vignetting.correction import compute_correction
from radiometry.vignetting.dng import DngVignette, export_dng
from radiometry.vignetting.gain_map import GainMap, export_gain_map
from radiometry.vignetting.lensfun import export_lensfun
from radiometry.vignetting.residuals import find_fit, read_residuals
from radiometry.vignetting.results import Fit
from radiometry.vignetting.xmp import export_xmp

_F_NUMBER: Final = ExportOption(name="f_number", kind="number")
_CHANNEL: Final = ExportOption(name="channel", kind="text")


def _write_lensfun(fitted: Fit, subject: ExportSubject, options: dict[str, Any]) -> str:
    coefficients = fitted.coefficients
    first = coefficients[0]
    names = name_for_lensfun(subject, options, width_px=first.width_px, height_px=first.height_px)
    return export_lensfun(coefficients, channels=select_channels(coefficients, signal="green"), names=names)


def _write_dng(fitted: Fit, _: ExportSubject, options: dict[str, Any]) -> str:
    channels = select_channels(fitted.coefficients, signal="green")
    found = export_dng(fitted.coefficients, channels=channels, f_number=options["f_number"])
    centre = {"centre_x_share": found.centre_x, "centre_y_share": found.centre_y}
    return _state_opcodes(fitted, found, options, k=list(found.k), **centre)


def _write_gain_map(fitted: Fit, _: ExportSubject, options: dict[str, Any]) -> str:
    found = export_gain_map(fitted.coefficients, cfa=fitted.cfa, f_number=options["f_number"])
    return _state_opcodes(fitted, found, options)


def _state_opcodes(
    fitted: Fit,
    found: DngVignette | GainMap,
    options: dict[str, Any],
    **more: Any,  # noqa: ANN401  JSON
) -> str:
    frame = fitted.coefficients[0]
    return json.dumps(
        {
            "f_number": options["f_number"],
            "width_px": frame.width_px,
            "height_px": frame.height_px,
            **more,
            "largest_error_rel": found.largest_error_rel,
            "opcode_list_base64": base64.b64encode(found.opcode_list).decode(),
        }
    )


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
        filename="dng.json",
        label="DNG opcode",
        media_type="application/json",
        operation="get_dng_vignette",
        description="The parameters of DNG's FixVignetteRadial at one f-number, and the opcode as "
        "OpcodeList3 holds it.",
        write=_write_dng,
        options=(_F_NUMBER,),
    ),
    Export(
        filename="gain-map.json",
        label="DNG gain map",
        media_type="application/json",
        operation="get_dng_gain_map",
        description="DNG's GainMap at one f-number, an opcode for each position of the mosaic, as "
        "OpcodeList2 holds them.",
        write=_write_gain_map,
        options=(_F_NUMBER,),
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
        filename="vignetting.xmp",
        label="XMP sidecar",
        media_type="application/rdf+xml",
        operation="get_vignetting_xmp",
        description="The falloff as an XMP sidecar, as MicaSense cameras state it. VignettingCenter and "
        "VignettingPolynomial of one f-number and channel.",
        write=lambda fitted, _, asked: export_xmp(find_fit(fitted.channel_fits, **asked).coefficient),
        options=(_F_NUMBER, _CHANNEL),
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
