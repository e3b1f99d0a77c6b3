"""Spectra of lamps and responses of cameras, and the factor between shown and true luminance."""

import math
import re
from functools import cache
from importlib.resources import files
from statistics import median

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import declare, error, flag_measurement
from radiometry.records import Record

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

SPECTRAL_MISMATCH_UNKNOWN = flag_measurement(
    "The spectrum of the calibration's lamp, of the measured light, or the camera's response is not known: "
    "its effect is assumed.",
    "State what the detail names: `lamp` or `lamp_kind` and `camera_response` with the campaign "
    "of the calibration, `light_source` or `lamp_kind` with the measurement or its campaign; or "
    "`spectral_mismatch_u_rel`.",
)
SPECTRUM_INVALID = error(
    "A lamp or a camera response is neither a name of the library nor a table that can be read.",
    "Send a name of the library, or at least 10 lines of rising wavelength from 400 to 700 nm and "
    "value (R, G and B of a response).",
)
FINDINGS = declare(globals())

OBSERVER = "V"
CHANNELS = ("R", "G", "B")
_FIRST_NM, _LAST_NM, _STEP_NM = 380, 780, 5
_FINE_NM = np.arange(_FIRST_NM, _LAST_NM + 1, dtype=np.float64)
_TRIANGLE = np.convolve(np.ones(_STEP_NM), np.ones(_STEP_NM)) / _STEP_NM**2
_FEWEST_ROWS = 10
_MUST_COVER_NM = (400.0, 700.0)


def list_lamps() -> tuple[str, ...]:
    """Return the CIE names of the lamps in the library, such as "HP1" and "LED-B3"."""
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
    """Return V of the CIE 1924 photopic observer at 380 to 780 nm, every 5 nm."""
    return _read_library("lamps.csv")[OBSERVER]


def read_lamp(text: str) -> Vector:
    """Return the relative spectrum of a lamp of the library, or of a table of wavelength [nm] and value."""
    if is_table(text):
        return _parse(text, 1)[:, 0]
    return _read_library("lamps.csv")[name_curve(text, list_lamps())]


def read_response(text: str) -> Matrix:
    """Return a camera's response, columns R, G, B: of the library, or of a table that opens with the [nm]."""
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


SOURCE = "spectral mismatch"
DEFAULT_U_REL = 0.1
"""Standard uncertainty where lamp, response or light is unknown: over the library's lamps the published
cameras err by 12 to 16 % rms with green after a calibration under illuminant A."""

LEAST_U_REL = 0.02  # what no correction falls below, also for two lamps of the same kind

_REFERENCE = "A"
_WEIGHTS = {"green": np.array([0.0, 1.0, 0.0]), "grey": np.array([0.25, 0.5, 0.25])}
_SHIFT_STEPS = 0.4  # 2 nm of the grid
_LAMP_KIND_REL = 0.15
_MARGIN = 0.1
# Of what V sees: less is a wrong column, not a camera.
_LEAST_RESPONSE = 1e-6


def compute_mismatch(response: str, *, channel: str, calibrated: str, measured: str) -> float:
    """Compute the factor between shown and true luminance.

    With the response s, the calibration's spectrum C, the measured one Z and V of the CIE 1924 observer [1]::

        F = (int Z V / int Z s) (int C s / int C V)

    [1] ISO/CIE 19476:2014, Characterization of the performance of illuminance and luminance meters, section
    4.2
    """
    s = read_response(response) @ _WEIGHTS[channel]
    return _compute_factor(s, read_lamp(calibrated), read_lamp(measured))


def compute_f1_prime(response: str, *, channel: str) -> float:
    """Compute the general spectral mismatch index of a camera.

    With s scaled so that it responds to illuminant A as V does, s* = s int A V / int A s [1]::

        f1' = int |s* - V| / int V

    [1] ISO/CIE 19476:2014, Characterization of the performance of illuminance and luminance meters, section
    4.2
    """
    s, v, a = read_response(response) @ _WEIGHTS[channel], read_observer(), read_lamp(_REFERENCE)
    return float(np.abs(s * (a @ v) / (a @ s) - v).sum() / v.sum())


def estimate_u_rel(response: str, *, channel: str, calibrated: str, measured: str) -> float:
    """Estimate the relative standard uncertainty of a mismatch factor.

    Sum in squares of three: a response whose wavelengths are off by 2 nm, as from one body to another; a lamp
    that differs from the library's of its kind by 15 % of ln F; and `LEAST_U_REL`.
    """
    s = read_response(response) @ _WEIGHTS[channel]
    c, z = read_lamp(calibrated), read_lamp(measured)
    slope = _SHIFT_STEPS * np.gradient(s)
    up, down = _compute_factor(s + slope, c, z), _compute_factor(s - slope, c, z)
    kind = _LAMP_KIND_REL * np.log(_compute_factor(s, c, z))
    return float(np.linalg.norm([np.log(up / down) / 2.0, kind, LEAST_U_REL]))


@cache
def find_confusion(channel: str) -> float:
    """Find by how much two lamps of equal luminance can differ in what a camera shows.

    Parameters
    ----------
    channel : str
        "green" or "grey".

    Returns
    -------
    float
        Largest ln(F_i / F_j) of two lamps, over the library's lamps and responses.
    """
    spans = []
    for camera in list_responses():
        factors = [
            compute_mismatch(camera, channel=channel, calibrated=_REFERENCE, measured=lamp)
            for lamp in list_lamps()
        ]
        spans.append(math.log(max(factors) / min(factors)))
    return max(spans)


class ColourRemedy(Record):
    """Mismatch factor from a region's own raw colour, for light whose spectrum is unknown."""

    # a, b and c of ln F = a + b ln(R/G) + c ln(B/G), colours over those under the calibration's lamp
    intercept: float
    red: float
    blue: float
    rms_rel: float  # rms error of F for lamps, and a camera, that were left out
    # smallest and largest of ln(R/G) and ln(B/G) over the lamps
    red_range: tuple[float, float]
    blue_range: tuple[float, float]

    @property
    def u_rel(self) -> float:
        return math.hypot(self.rms_rel, LEAST_U_REL)

    @property
    def factor(self) -> float:
        """Factor for a region of the calibration's colour; of any where it does not depend on the colour."""
        return math.exp(self.intercept)

    def predict(self, red_to_green: float, blue_to_green: float) -> float | None:
        x = np.log([red_to_green, blue_to_green])
        for value, (low, high) in zip(x, (self.red_range, self.blue_range), strict=True):
            if not low - _MARGIN <= value <= high + _MARGIN:
                return None
        return float(np.exp(self.intercept + self.red * x[0] + self.blue * x[1]))


@cache
def fit_colour_remedy(
    responses: tuple[str, ...],
    *,
    channel: str,
    calibrated: tuple[str, ...],
    measured: tuple[str, ...] = (),
    by_colour: bool = True,
) -> ColourRemedy:
    """Fit the mismatch factor to the raw colours of lamps.

    b and c by ordinary least squares of ln F over the library's lamps, with an intercept per camera; then a
    as the mean of what is left over the pairs of lamps. Each pair is predicted from the other cameras, if
    there are any, and from the other lamps, as far as a side has others [1].

    [1] D. M. Allen, Technometrics 16, 125 (1974), doi:10.1080/00401706.1974.10489157
    """
    library, ends = list_lamps(), (calibrated, measured or list_lamps())
    rows = {
        camera: {lamp: _describe(camera, lamp, channel) for lamp in {*library, *ends[0], *ends[1]}}
        for camera in responses
    }

    def solve(cameras: tuple[str, ...], without: frozenset[str]) -> Vector:
        pool = [lamp for lamp in library if lamp not in without]
        each = [np.array([rows[camera][lamp] for lamp in pool]) for camera in cameras]
        table = np.vstack([block - block.mean(axis=0) for block in each])
        slopes = np.linalg.pinv(table[:, 1:]) @ table[:, 0] if by_colour else np.zeros(2)
        kept = [[lamp for lamp in end if lamp not in without] or end for end in ends]
        apart = [rows[camera][z] - rows[camera][c] for camera in cameras for c in kept[0] for z in kept[1]]
        mean = np.mean(apart, axis=0)
        return np.array([mean[0] - slopes @ mean[1:], *slopes])

    # two lamps of one kind are two, but the calibration's may be the only one of its own
    pairs = [(c, z) for c in ends[0] for z in ends[1] if c != z or len(ends[0]) == 1]
    errors, colours = [], []
    for camera in responses:
        others = tuple(each for each in responses if each != camera) or (camera,)
        for c, z in pairs:
            shown = rows[camera][z] - rows[camera][c]
            intercept, red, blue = solve(others, frozenset({z, c} if len(ends[0]) > 1 else {z}))
            errors.append(intercept + red * shown[1] + blue * shown[2] - shown[0])
            colours.append(shown[1:])
    intercept, red, blue = (float(each) for each in solve(responses, frozenset()))
    low, high = np.min(colours, axis=0), np.max(colours, axis=0)
    return ColourRemedy(
        intercept=intercept,
        red=red,
        blue=blue,
        rms_rel=float(np.sqrt(np.mean(np.expm1(errors) ** 2))),
        red_range=(float(low[0]), float(high[0])),
        blue_range=(float(low[1]), float(high[1])),
    )


@cache
def _describe(camera: str, lamp: str, channel: str) -> Vector:
    """Return ln(int Z V / int Z s), ln(R/G) and ln(B/G) of a camera under a lamp."""
    rgb, z = read_response(camera), read_lamp(lamp)
    seen = math.log(float(z @ read_observer()) / _integrate(z, rgb @ _WEIGHTS[channel]))
    red, green, blue = (_integrate(z, channel) for channel in rgb.T)
    return np.array([seen, *np.log([red / green, blue / green])])


def _compute_factor(s: Vector, c: Vector, z: Vector) -> float:
    v = read_observer()
    return float((z @ v) / _integrate(z, s) * _integrate(c, s) / (c @ v))


def _integrate(lamp: Vector, s: Vector) -> float:
    """Integrate the response to a lamp, and refuse a pair without any."""
    found = float(lamp @ s)
    if found <= _LEAST_RESPONSE * float(lamp @ read_observer()):
        raise SPECTRUM_INVALID.refuse("A channel of the camera's response does not see a lamp at all.")
    return found
