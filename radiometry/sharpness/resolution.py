"""Frequencies in the units in common use, and a star's resolving power."""

import math
from dataclasses import dataclass

import numpy as np

from radiometry.sharpness.features import Contrasts, Estimate

SMALL_FORMAT_HEIGHT_MM = 24.0

_NEIGHBOURS = 3
_LEAST_CONTRAST = 1e-4


@dataclass(frozen=True, kw_only=True)
class Resolution:
    """One frequency in every unit.

    Attributes
    ----------
    cycles_per_pixel : float
        Frequency [cycles per pixel].
    lp_per_mm : float or None
        Line pairs per millimetre on the sensor itself; None without its pitch.
    lp_per_ph, lw_per_ph : float
        Line pairs, and line widths, per picture height.
    lp_per_mm_small_format : float
        Line pairs per millimetre on a picture enlarged to 24 mm height.
    """

    cycles_per_pixel: float
    lp_per_mm: float | None
    lp_per_ph: float
    lw_per_ph: float
    lp_per_mm_small_format: float


def convert_resolution(
    cycles_per_pixel: float, *, picture_height_px: int, pixel_pitch_um: float | None = None
) -> Resolution:
    """Compute a frequency in line pairs and line widths.

    Parameters
    ----------
    cycles_per_pixel : float
        Frequency f [cycles per pixel].
    picture_height_px : int
        Shorter side N of the picture [px].
    pixel_pitch_um : float or None, default: None
        Pixel pitch p [um]; None if unknown.

    Notes
    -----
    lp/mm = f / p,   LP/PH = f N,   LW/PH = 2 f N,   small format: f N / 24 mm

    A line pair is one cycle, a line WIDTH half of one. Equation 3 of the source multiplies by 2, divides
    by 24 mm and calls the result lp/mm: it is line widths per millimetre of a 24 mm picture. Its 26.1 for
    N = 1024 is 0.3059 cycles per pixel and 13.05 lp/mm.
    """
    pairs = cycles_per_pixel * picture_height_px
    return Resolution(
        cycles_per_pixel=cycles_per_pixel,
        lp_per_mm=None if pixel_pitch_um is None else cycles_per_pixel / pixel_pitch_um * 1000.0,
        lp_per_ph=pairs,
        lw_per_ph=2.0 * pairs,
        lp_per_mm_small_format=pairs / SMALL_FORMAT_HEIGHT_MM,
    )


def unresolved_diameter(resolving_power: float, *, cycles: int) -> float:
    """Compute the diameter of the disc in which a star is not resolved, d = n / (pi RP) [px].

    Parameters
    ----------
    resolving_power : float
        Resolving power RP [cycles per pixel].
    cycles : int
        Cycles n of the star.

    Returns
    -------
    float
        Diameter d [px].

    Notes
    -----
    The source calls d the distance from the centre to the unresolved circle's edge; with that radius its
    equation 2 gives twice the resolving power. 48 cycles and 0.5 cycles per pixel: 30.56 px across.
    """
    return cycles / (math.pi * resolving_power)


def find_resolving_power(
    frequency: tuple[float, ...], curve: Contrasts, *, contrast: float
) -> Estimate | None:
    """Find the frequency at which a star's contrast first falls below a level.

    Parameters
    ----------
    frequency : tuple of float
        Rising frequencies [cycles per pixel].
    curve : Contrasts
        Contrast at each frequency.
    contrast : float
        Level, relative to the contrast far outside.

    Returns
    -------
    Estimate or None
        Frequency [cycles per pixel]; None if the contrast never falls below the level.

    Notes
    -----
    Between the last ring above the level and the first below, ln(contrast) is interpolated over f^2, where
    a Gaussian blur is a straight line. The difference from a straight line in contrast over f is the
    standard uncertainty of the model; that of the rings is u(contrast at the root) / |slope|, with the mean
    slope over three rings on either side, since noise chooses the steepest pair to cross.
    """
    values, u = np.array(curve.contrast), np.array(curve.contrast_u)
    below = np.flatnonzero(values < contrast)
    if not below.size or below[0] == 0:
        return None
    pair = slice(int(below[0]) - 1, int(below[0]) + 1)
    f, ring_u = np.array(frequency)[pair], u[pair]
    # a contrast within its noise has no logarithm of meaning
    logs = np.log(np.maximum(values[pair], np.maximum(ring_u, _LEAST_CONTRAST)))
    line, curved = (
        float((start - level) / (start - end))
        for start, end, level in ((*values[pair], contrast), (*logs, math.log(contrast)))
    )
    root = math.sqrt(f[0] ** 2 + min(curved, 1.0) * (f[1] ** 2 - f[0] ** 2))
    straight = f[0] + line * (f[1] - f[0])
    around = slice(max(0, pair.stop - 1 - _NEIGHBOURS), pair.stop - 1 + _NEIGHBOURS)
    fall = values[around][0] - values[around][-1]
    span = np.array(frequency)[around][-1] - np.array(frequency)[around][0]
    if fall <= 0.0:
        fall, span = values[pair][0] - values[pair][1], f[1] - f[0]
    noise_u = math.hypot((1.0 - line) * ring_u[0], line * ring_u[1]) * span / fall
    return Estimate(value=root, standard_uncertainty=math.hypot(float(noise_u), straight - root))
