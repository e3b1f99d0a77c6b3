"""A version in the forms that other programs read."""

import json
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from radiometry.findings import InputRejected, shared
from radiometry.frame.packing import unpack
from radiometry.specification.exports import Export, ExportOption, ExportSubject, Picture
from radiometry.specification.lensfun import LensfunNames, list_options, name_for_lensfun, write_database
from radiometry.vignetting.blocks import Vector
from radiometry.vignetting.lens import compute_correction, evaluate, select_channels
from radiometry.vignetting.results import ChannelFit, Coefficient, Fit

_TERMS = 3  # of Lensfun's model "pa"
_SAMPLES = 129  # Along each side of the frame: odd, so that the middle is one of them


def export_lensfun(
    coefficients: Sequence[Coefficient], *, channels: Sequence[str], names: LensfunNames
) -> str:
    """Write a Lensfun database with the camera, the lens, and one vignetting element per f-number.

    Model "pa" is V itself [1]: light times 1 + k1 r^2 + k2 r^4 + k3 r^6, r = 1 at the half diagonal, from
    the middle of the frame: the database's schema has no centre for a lens [2]. V is therefore refitted
    about the middle; a comment beside each element states the remaining error. V is the mean over channels.

    [1] Lensfun manual, "Lens calibration data format"
    [2] lensfun-database.xsd of Lensfun's database
    """
    elements = [
        _write_element(coefficients, f_number, channels, names)
        for f_number in sorted({each.f_number for each in coefficients})
    ]
    first = coefficients[0]
    return write_database(
        names,
        elements,
        width_px=first.width_px,
        height_px=first.height_px,
        widest_f_number=min(each.f_number for each in coefficients),
    )


def _write_element(
    coefficients: Sequence[Coefficient], f_number: float, channels: Sequence[str], names: LensfunNames
) -> str:
    first = coefficients[0]
    middle_row, middle_col = (first.height_px - 1) / 2.0, (first.width_px - 1) / 2.0

    def average(rows: Vector, cols: Vector) -> Vector:
        found = [evaluate(coefficients, rows, cols, channel=name, f_number=f_number) for name in channels]
        return np.asarray(np.mean([each.share for each in found], axis=0))

    rows = np.linspace(0.0, first.height_px - 1.0, _SAMPLES)[:, None]
    cols = np.linspace(0.0, first.width_px - 1.0, _SAMPLES)[None, :]
    # Lensfun's r is 1 at the centre of the corner pixel
    squared = ((rows - middle_row) ** 2 + (cols - middle_col) ** 2) / (middle_row**2 + middle_col**2)
    # about another point V is not 1: the level there is divided out, as a correction may
    wanted = average(rows, cols) / average(np.array([middle_row]), np.array([middle_col]))
    (k1, k2, k3), error = _fit_even_powers(np.asarray(squared), wanted)
    return (
        f"            <!-- f/{f_number:g}: largest error of the curve about the middle {error:.2%} -->\n"
        f'            <vignetting model="pa" focal="{names.focal_length_mm:.9g}" aperture="{f_number:.9g}" '
        f'distance="{names.distance_m:.9g}" k1="{k1:.9g}" k2="{k2:.9g}" k3="{k3:.9g}"/>'
    )


def _fit_even_powers(squared: Vector, wanted: Vector) -> tuple[tuple[float, ...], float]:
    """Fit 1 + k1 r^2 + k2 r^4 + k3 r^6 to values; return the k, and the largest relative error."""
    powers = np.stack([squared.ravel() ** power for power in range(1, _TERMS + 1)], axis=1)
    target = wanted.ravel()
    found = np.linalg.lstsq(powers / target[:, None], 1.0 - 1.0 / target, rcond=None)[0]
    error = float(np.abs((1.0 + powers @ found) / target - 1.0).max())
    return tuple(float(each) for each in found), error


def find_fit(fits: Sequence[ChannelFit], *, f_number: float, channel: str) -> ChannelFit:
    """Return the fit of one f-number and channel."""
    for fit in fits:
        if (fit.coefficient.f_number, fit.coefficient.channel) == (f_number, channel):
            return fit
    known = ", ".join(f"f/{each.coefficient.f_number:g} {each.coefficient.channel}" for each in fits)
    raise InputRejected(
        shared.VIGNETTING_NOT_CALIBRATED,
        f"No flat was fitted at f/{f_number:g}, channel {channel}; there are {known}. Ask for one of these.",
    )


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
    fit = find_fit(fitted.channel_fits, **options)
    said = {
        "quantity": "(light - fitted) / fitted",
        "unit": "1",
        **options,
        "block_px": fit.block_px,
        "residual_rms_rel": fit.residual_rms_rel,
        "calibration_id": subject.calibration_id,
    }
    return Picture(samples=unpack(fit.residuals).astype(np.float32), description=json.dumps(said))


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
