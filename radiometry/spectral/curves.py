"""Spectral curves on one grid of wavelengths: the library's, and a user's own."""

import re
from functools import cache
from importlib.resources import files
from statistics import median

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import error, flag

__all__ = [
    "SPECTRAL_MISMATCH_UNKNOWN",
    "find_response",
    "list_lamps",
    "read_lamp",
    "read_observer",
    "read_response",
]

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

SPECTRUM_INVALID = error(
    "spectrum_invalid",
    "A lamp or a camera response is neither a name of the library nor a table that can be read.",
    "Send a name of the library, or at least 10 lines of rising wavelength from 400 to 700 nm and "
    "value (R, G and B of a response).",
)
SPECTRAL_MISMATCH_UNKNOWN = flag(
    "spectral_mismatch_unknown",
    "The spectrum of the calibration's lamp, of the measured light, or the camera's response is not known: "
    "its effect is assumed.",
    "State what the detail names: `lamp` or `lamp_kind` and `camera_response` with the campaign "
    "of the calibration, `light_source` or `lamp_kind` with the measurement or its campaign; or "
    "`spectral_mismatch_u_rel`.",
    "measurement",
)
OBSERVER = "V"
CHANNELS = ("R", "G", "B")
_FIRST_NM, _LAST_NM, _STEP_NM = 380, 780, 5
_FINE_NM = np.arange(_FIRST_NM, _LAST_NM + 1, dtype=np.float64)
_TRIANGLE = np.convolve(np.ones(_STEP_NM), np.ones(_STEP_NM)) / _STEP_NM**2
_FEWEST_ROWS = 10
_MUST_COVER_NM = (400.0, 700.0)


def list_lamps() -> tuple[str, ...]:
    """Return the names of the lamps in the library.

    Returns
    -------
    tuple of str
        CIE names, such as "HP1" and "LED-B3".
    """
    return tuple(name for name in _read_library("lamps.csv") if name != OBSERVER)


def list_responses() -> tuple[str, ...]:
    """Return manufacturer and model of the cameras whose response is in the library."""
    return tuple(dict.fromkeys(name[:-2] for name in _read_library("responses.csv")))


def find_response(make: str, model: str) -> str | None:
    """Return the published response of a camera model.

    Parameters
    ----------
    make, model : str
        Manufacturer and model as the camera's files state them.

    Returns
    -------
    str or None
        Name in the library; None if there is none of this model.
    """
    stated = f"{make} {model}".casefold().split()
    return next((name for name in list_responses() if set(name.casefold().split()) <= set(stated)), None)


def read_observer() -> Vector:
    """Return V, the luminous efficiency of the CIE 1924 photopic observer.

    Returns
    -------
    ndarray of float64
        Value at each wavelength of the grid: 380 to 780 nm, every 5 nm.
    """
    return _read_library("lamps.csv")[OBSERVER]


def read_lamp(text: str) -> Vector:
    """Return the relative spectrum of a lamp.

    Parameters
    ----------
    text : str
        Name of the library, or a table with the columns wavelength [nm] and value.

    Returns
    -------
    ndarray of float64
        Value at each wavelength of the grid.

    Raises
    ------
    InputRejected
        `spectrum_invalid`.
    """
    if is_table(text):
        return _parse(text, 1)[:, 0]
    return _read_library("lamps.csv")[name_curve(text, list_lamps())]


def read_response(text: str) -> Matrix:
    """Return the relative spectral response of a camera.

    Parameters
    ----------
    text : str
        Name of the library, or a table with the columns wavelength [nm], R, G and B.

    Returns
    -------
    ndarray of float64
        Values at each wavelength of the grid, columns R, G and B.

    Raises
    ------
    InputRejected
        `spectrum_invalid`.
    """
    if is_table(text):
        return _parse(text, len(CHANNELS))
    name, table = name_curve(text, list_responses()), _read_library("responses.csv")
    return np.column_stack([table[f"{name} {channel}"] for channel in CHANNELS])


def is_table(text: str) -> bool:
    return "\n" in text.strip()


def name_curve(text: str, known: tuple[str, ...]) -> str:
    """Return what a document calls a lamp or a response."""
    if is_table(text):
        return f"own table of {len(text.strip().splitlines())} lines"
    folded = text.strip().casefold().removeprefix("cie ")
    for name in known:
        if name.casefold() == folded:
            return name
    raise SPECTRUM_INVALID.refuse(f"{text.strip()!r} is none of {', '.join(known)}.")


def describe_curve(text: str | None, known: tuple[str, ...]) -> str:
    """Return what a document calls a lamp or a response that may be unknown."""
    return "not recorded" if text is None else name_curve(text, known)


def _parse(text: str, columns: int) -> Matrix:
    """Read a table; between its wavelengths values are interpolated, beyond them they are 0."""
    rows: list[list[float]] = []
    for line in text.strip().splitlines():
        bare = line.partition("#")[0].strip()
        cells = bare.replace(",", ".").split(";") if ";" in bare else re.split(r"[,\s]+", bare)
        try:
            rows.append([float(cell) for cell in cells])
        except ValueError:
            if rows:  # lines above the first row are its head
                raise SPECTRUM_INVALID.refuse(f"The line {line[:60]!r} is not a row of numbers.") from None
    if len(rows) < _FEWEST_ROWS or any(len(row) != columns + 1 for row in rows):
        raise SPECTRUM_INVALID.refuse(
            f"The table has {len(rows)} rows of numbers, and each needs {columns + 1}."
        )
    table = np.array(rows)
    wavelengths, values = table[:, 0], table[:, 1:]
    low, high = _MUST_COVER_NM
    if not (np.all(np.isfinite(table)) and np.all(np.diff(wavelengths) > 0)):
        raise SPECTRUM_INVALID.refuse("The wavelengths do not rise, or a number is not finite.")
    if wavelengths[0] > low or wavelengths[-1] < high:
        raise SPECTRUM_INVALID.refuse(f"The table covers {wavelengths[0]:g} to {wavelengths[-1]:g} nm.")
    # a spectrometer's dark noise is as often negative; more than that is another quantity
    if np.any(values.min(axis=0) < -0.02 * values.max(axis=0)) or np.any(values.max(axis=0) <= 0.0):
        raise SPECTRUM_INVALID.refuse("A column has negative values, or is 0 everywhere.")
    scaled = np.maximum(values, 0.0) / values.max()
    return np.column_stack([_resample(wavelengths, column) for column in scaled.T])


def _resample(wavelengths_nm: Vector, values: Vector) -> Vector:
    """Bring a curve to the grid; a finer one is averaged with a triangle, so that no line is lost."""
    fine = np.interp(_FINE_NM, wavelengths_nm, values, left=0.0, right=0.0)
    # numpy's median loads masked arrays, a tenth of the service's start
    if median(np.diff(wavelengths_nm).tolist()) < _STEP_NM:
        fine = np.convolve(fine, _TRIANGLE, mode="same")
    return fine[::_STEP_NM]


@cache
def _read_library(name: str) -> dict[str, Vector]:
    text = files(__package__).joinpath(name).read_text(encoding="utf-8")
    head, *rows = (line.split(",") for line in text.splitlines() if not line.startswith("#"))
    table = np.array(rows, np.float64)
    return {head[at]: _resample(table[:, 0], table[:, at]) for at in range(1, len(head))}
