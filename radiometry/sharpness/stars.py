"""One Siemens star in one channel: its centre, and its contrast by frequency, all around and by direction."""

import math

import numpy as np
import scipy
from numpy.typing import NDArray

from radiometry.sharpness import codes
from radiometry.sharpness.edges import MOST_CLIPPED_SHARE
from radiometry.sharpness.results import Contrasts, StarResponse
from radiometry.sharpness.sampling import Plane

Matrix = NDArray[np.float64]

_CENTRING_RINGS = 6


def guess_centre(picture: Matrix) -> tuple[float, float]:
    """Estimate the point about which a picture is most nearly symmetric or antisymmetric.

    A star turned by half a turn is itself (n even) or its negative (n odd), so the picture convolved with
    itself has its largest modulus at twice the centre. Slow changes of light are subtracted before.
    """
    size = max(3, min(picture.shape) // 8)
    fine = picture - scipy.ndimage.uniform_filter(picture, size, mode="nearest")
    shape = (2 * picture.shape[0], 2 * picture.shape[1])
    folded = np.abs(scipy.fft.irfft2(scipy.fft.rfft2(fine, shape) ** 2, shape))
    row, col = np.unravel_index(int(np.argmax(folded)), folded.shape)
    return float(row) / 2.0, float(col) / 2.0


def refine_centre(
    plane: Plane, *, start: tuple[float, float], cycles: int, radius_px: float
) -> tuple[float, float]:
    """Find the centre at which the star's fundamental is strongest, over rings of its outer half.

    P(c) = sum_rings |sum I exp(-i n theta)|^2 / N^2,  theta about c.   A centre that is d off turns the
    phase by n d / r around the ring, and weakens the sum.
    """
    rows = np.broadcast_to(plane.line_px[:, None], plane.values.shape).ravel()
    cols = plane.positions_px.ravel()
    signal = plane.values.ravel()
    near = np.hypot(rows - start[0], cols - start[1]) <= radius_px
    rows, cols, signal = rows[near], cols[near], signal[near]
    ring = np.hypot(rows - start[0], cols - start[1]) / radius_px * 2.0 * _CENTRING_RINGS
    index = np.minimum(ring.astype(np.intp), 2 * _CENTRING_RINGS - 1)
    outer = index >= _CENTRING_RINGS
    rows, cols, signal, index = rows[outer], cols[outer], signal[outer], index[outer] - _CENTRING_RINGS
    count = np.maximum(np.bincount(index, minlength=_CENTRING_RINGS), 1)
    signal = signal - (np.bincount(index, signal, _CENTRING_RINGS) / count)[index]

    def weakness(centre: Matrix) -> float:
        phase = cycles * np.arctan2(rows - centre[0], cols - centre[1])
        real = np.bincount(index, signal * np.cos(phase), _CENTRING_RINGS) / count
        imaginary = np.bincount(index, signal * np.sin(phase), _CENTRING_RINGS) / count
        return -float(np.sum(real**2 + imaginary**2))

    first = np.array(start)
    simplex = np.array([first, first + np.array([0.7, 0.0]), first + np.array([0.0, 0.7])])
    options = {"initial_simplex": simplex, "xatol": 1e-3, "fatol": 0.0, "maxiter": 120}
    found = scipy.optimize.minimize(weakness, first, method="Nelder-Mead", options=options).x
    return float(found[0]), float(found[1])


Vector = NDArray[np.float64]

SECTORS = 8
LEAST_MODULATION = 0.1
LEAST_SPAN = 3.0

_RINGS = 48
_REFERENCE_RINGS = 6
_WIDTH_REL = 0.05
_WIDTH_SAMPLES = 1.5
_STAR_SHARE = 0.7
_LEAST_EXPLAINED = 0.4
_NEIGHBOURS = 3
_STEEPEST = 8.0  # d ln M / d ln f of a Gaussian blur where its contrast is 2 %


def measure_star(plane: Plane, *, cycles: int, centre: tuple[float, float], radius_px: float) -> StarResponse:
    """Measure a star's contrast on rings, by a fit of its fundamental in each of eight sectors.

    With the s-SFR of [1]::

        I = a + b cos(n theta) + c sin(n theta),   M = sqrt(b^2 + c^2) / a,   f = n / (2 pi r)

    Noise makes b and c larger than they are: the variance of both is subtracted from their squares. All
    directions together are the root of the mean square, from which is taken what a ring's width of 2 w r adds
    to a contrast that falls as a Gaussian blur's does, 1 + (w d ln M / d ln f)^2 / 6. The contrast is M
    relative to that of the six outermost rings of the star, whose own blur is left in. A star of bars has a
    fundamental 4/pi as large, which cancels. Rings end at the channel's Nyquist frequency.

    [1] ISO 12233:2023 annex E (s-SFR)
    """
    _require_unclipped(plane)
    # the highest frequency that a channel's lattice carries in every direction [cycles/px]
    nyquist = 0.5 / math.sqrt(plane.pitch_px * float(plane.line_px[1] - plane.line_px[0]))
    inner_px = cycles / (2.0 * math.pi * nyquist)
    _require_span(radius_px, inner_px, plane.channel)
    radii = np.geomspace(inner_px, radius_px, _RINGS)[::-1]
    square, variance, explained = _fit_rings(plane, radii, cycles=cycles, centre=centre)
    mean = np.sqrt(np.maximum(0.0, np.mean(square, axis=1)))
    excess = _find_excess(mean, radii, plane.pitch_px)
    mean, square, variance = mean / excess, square / excess[:, None] ** 2, variance / excess[:, None] ** 2
    outer = int(np.flatnonzero(mean >= _STAR_SHARE * mean.max())[0])
    _require_span(float(radii[outer]), inner_px, plane.channel)
    reference = slice(outer, outer + _REFERENCE_RINGS)
    strength = float(mean[reference].mean())
    if float(explained[reference].mean()) < _LEAST_EXPLAINED:
        raise codes.STAR_NOT_FOUND.reject(
            f"A star of {cycles} cycles explains {float(explained[reference].mean()):.0%} of what channel "
            f"{plane.channel} "
            "shows about the centre: another number of cycles, a star seen at a slant, or no star. Correct "
            "the target."
        )
    if strength < LEAST_MODULATION:
        raise codes.CHART_CONTRAST_TOO_LOW.reject(
            f"The star's contrast is {strength:.1%} in channel {plane.channel}, less than "
            f"{LEAST_MODULATION:.0%}."
        )
    modulation = np.sqrt(np.maximum(0.0, square[outer:]))
    bases = modulation[:_REFERENCE_RINGS].mean(axis=0)
    contrast, u = modulation / bases, np.sqrt(variance[outer:]) / bases
    sectors = tuple(
        _describe(contrast[:, each], u[:, each], direction_deg=360.0 / SECTORS * each)
        for each in range(SECTORS)
    )
    whole_u = np.sqrt(variance[outer:].sum(axis=1)) / SECTORS / strength
    return StarResponse(
        channel=plane.channel,
        cycles=cycles,
        centre_row_px=centre[0],
        centre_col_px=centre[1],
        outer_radius_px=float(radii[outer]),
        modulation=strength,
        frequency=tuple(float(cycles / (2.0 * math.pi * radius)) for radius in radii[outer:]),
        whole=_describe(mean[outer:] / strength, whole_u, direction_deg=None),
        sectors=sectors,
    )


def _describe(contrast: Vector, u: Vector, *, direction_deg: float | None) -> Contrasts:
    return Contrasts(
        direction_deg=direction_deg,
        contrast=tuple(float(value) for value in contrast),
        contrast_u=tuple(float(value) for value in u),
    )


def _find_half_width(radius: float, pitch_px: float) -> float:
    return max(_WIDTH_SAMPLES * pitch_px, _WIDTH_REL * radius) / 2.0


def _find_excess(modulation: Vector, radii: Vector, pitch_px: float) -> Vector:
    """Return by which factor the mean over each ring's width exceeds the modulation at its radius."""
    width = np.array([_find_half_width(radius, pitch_px) / radius for radius in radii])
    at = np.arange(radii.size)
    outside, inside = np.maximum(at - _NEIGHBOURS, 0), np.minimum(at + _NEIGHBOURS, radii.size - 1)
    fall = (modulation[outside] - modulation[inside]) / np.log(radii[outside] / radii[inside])
    slope = np.minimum(fall / np.maximum(modulation, 1e-9), _STEEPEST)
    return np.asarray(1.0 + (width * slope) ** 2 / 6.0, np.float64)


def _fit_rings(
    plane: Plane, radii: Vector, *, cycles: int, centre: tuple[float, float]
) -> tuple[Vector, Vector, Vector]:
    """Return the modulation's square and variance, (ring, sector), and the share explained, (ring,).

    The share is that of one fundamental all around the ring: in a sector alone other numbers of cycles also
    fit.
    """
    rows = np.broadcast_to(plane.line_px[:, None], plane.values.shape).ravel() - centre[0]
    cols = plane.positions_px.ravel() - centre[1]
    signal = plane.values.ravel()
    distance, angle = np.hypot(rows, cols), np.arctan2(rows, cols)
    order = np.argsort(distance, kind="stable")
    distance, angle, signal = distance[order], angle[order], signal[order]
    sector = np.floor(angle / (2.0 * np.pi) * SECTORS + 0.5).astype(np.intp) % SECTORS
    square, variance = np.zeros((radii.size, SECTORS)), np.zeros((radii.size, SECTORS))
    explained = np.zeros(radii.size)
    for ring, radius in enumerate(radii):
        half = _find_half_width(radius, plane.pitch_px)
        part = slice(*np.searchsorted(distance, (radius - half, radius + half)))
        for each in range(SECTORS):
            chosen = sector[part] == each
            square[ring, each], variance[ring, each], _ = _fit_fundamental(
                angle[part][chosen], signal[part][chosen], cycles
            )
        explained[ring] = _fit_fundamental(angle[part], signal[part], cycles)[2]
    return square, variance, explained


def _fit_fundamental(angle: Vector, signal: Vector, cycles: int) -> tuple[float, float, float]:
    """Fit a + b cos + c sin; return modulation squared, its variance, and share of variance explained.

    The noise's part is subtracted from the square, so that without a star it is 0 on average, above or below.
    """
    design = np.column_stack((np.ones(angle.size), np.cos(cycles * angle), np.sin(cycles * angle)))
    moments = design.T @ design
    if angle.size < 6 or np.linalg.cond(moments) > 1e8:
        raise codes.STAR_TOO_SMALL.reject(
            "A ring of the star holds too few samples in one direction: fill more of the frame."
        )
    inverse = np.linalg.inv(moments)
    base, cosine, sine = inverse @ (design.T @ signal)
    left = float(np.sum((signal - design @ (base, cosine, sine)) ** 2))
    noise = left / (angle.size - 3)
    bias = noise * float(inverse[1, 1] + inverse[2, 2])
    total = float(np.sum((signal - signal.mean()) ** 2))
    explained = 1.0 - left / total if total > 0.0 else 0.0
    if base <= 0.0:
        return 0.0, 0.0, explained
    return float(cosine**2 + sine**2 - bias) / base**2, bias / 2.0 / base**2, explained


def _require_unclipped(plane: Plane) -> None:
    if plane.clipped_share > MOST_CLIPPED_SHARE:
        raise codes.CHART_CLIPPED.reject(
            f"{plane.clipped_share:.2%} of channel {plane.channel} in the region is at white or at zero, "
            "more than "
            f"{MOST_CLIPPED_SHARE:.1%}. Change the exposure, or draw the region closer about the star."
        )


def _require_span(outer_px: float, inner_px: float, channel: str) -> None:
    """Refuse a star that does not reach well below the Nyquist frequency: nothing to compare with."""
    if outer_px < LEAST_SPAN * inner_px:
        raise codes.STAR_TOO_SMALL.reject(
            f"The star reaches {outer_px:.0f} px from its centre; channel {channel} carries its spokes "
            "only from "
            f"{inner_px:.0f} px on, and {LEAST_SPAN:g} times that is needed. Go closer, or take a star of "
            "fewer cycles."
        )
