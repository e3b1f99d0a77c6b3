"""Histogram of a map's area, from an exact count of every value that occurs in it."""

import math
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

Rank = Literal["value", "too_dark", "unknown"]

PERCENTS: Final = (1, 5, 10, 25, 50, 75, 90, 95, 99)
_DROPPED_BITS: Final = 11
"""Of a float32's 32: 12 bits of mantissa stay, as many as the maps of this product keep."""

_KEYS: Final = 1 << (32 - _DROPPED_BITS)
_SIGN: Final = np.uint32(1 << 31)
_LINEAR_TOP: Final = 0.995


class ValueCounts:
    """Number of pixels of each value, to 12 bits of mantissa, and of those without a value."""

    def __init__(self) -> None:
        """Start with no pixel."""
        self._counts = np.zeros(_KEYS, np.int64)
        self.unknown = 0

    def add(self, values: NDArray[np.float32]) -> None:
        """Count more pixels, of which those that are not finite are unknown.

        Parameters
        ----------
        values : ndarray of float32
            Values.
        """
        known = np.isfinite(values)
        self.unknown += int(values.size - np.count_nonzero(known))
        bits = np.ascontiguousarray(values[known], np.float32).view(np.uint32)
        # in the order of the values
        keys = np.where(bits & _SIGN, ~bits, bits | _SIGN) >> np.uint32(_DROPPED_BITS)
        self._counts += np.bincount(keys, minlength=_KEYS)

    def list_values(self) -> tuple[Array, NDArray[np.int64]]:
        """Return the values that occur, in ascending order, and how often each does."""
        keys = np.flatnonzero(self._counts).astype(np.uint32)
        raised = keys << np.uint32(_DROPPED_BITS)
        bits = np.where(raised & _SIGN, raised ^ _SIGN, ~(raised | np.uint32((1 << _DROPPED_BITS) - 1)))
        return bits.astype(np.uint32).view(np.float32).astype(np.float64), self._counts[keys]


@dataclass(frozen=True, kw_only=True)
class Percentile:
    """A percentile of all pixels; ``rank`` is "value" where it is known, else why it is not."""

    percent: int
    rank: Rank
    value: float | None


@dataclass(frozen=True, kw_only=True)
class AreaHistogram:
    """Pixels of an area by their values: bins, and what lies in none; together they are all pixels.

    Attributes
    ----------
    pixels : int
        All pixels of the area.
    unknown : int
        Pixels without a value: saturated.
    too_dark : int
        Pixels below `limit`, in no bin.
    limit : float or None
        Value below which a pixel is not distinguished from zero; None where zero is a value like others.
    below, above : int
        Pixels beyond the first and the last edge.
    edges : ndarray of float64
        Edges of the bins, (n + 1,); a bin holds its lower edge, the last one both.
    counts : ndarray of int64
        Pixels of each bin, (n,).
    mean, smallest, largest : float or None
        Of the pixels with a value, those that are too dark included.
    percentiles : tuple of Percentile
        Of all pixels: those that are too dark rank lowest, the saturated highest.
    """

    pixels: int
    unknown: int
    too_dark: int
    limit: float | None
    below: int
    above: int
    edges: Array
    counts: NDArray[np.int64]
    mean: float | None
    smallest: float | None
    largest: float | None
    percentiles: tuple[Percentile, ...]


def make_histogram(
    counted: ValueCounts,
    *,
    limit: float | None,
    logarithmic: bool,
    bins: int,
    ends: tuple[float | None, float | None] = (None, None),
) -> AreaHistogram:
    """Put counted values into bins.

    Parameters
    ----------
    counted : ValueCounts
        Values of the area.
    limit : float or None
        Value below which a pixel is not distinguished from zero.
    logarithmic : bool
        True for bins of one ratio, False for bins of one width.
    bins : int
        Number of bins.
    ends : tuple of float or None, optional
        First and last edge. Left out: of a logarithmic axis all values above zero and the limit; of a
        linear one from zero, or the smallest if that is below zero, to the 99.5th percentile.
    """
    values, counts = counted.list_values()
    total = int(counts.sum())
    dark = values < (-math.inf if limit is None else limit)
    too_dark = int(counts[dark].sum())
    shown, weights = values[~dark], counts[~dark]
    if logarithmic:
        shown, weights = shown[shown > 0.0], weights[shown > 0.0]
    edges = _lay_edges(shown, weights, logarithmic=logarithmic, bins=bins, ends=ends)
    # the sum of integers in doubles is exact
    filled = np.histogram(shown, edges, weights=weights.astype(np.float64))[0].astype(np.int64)
    above = int(counts[~dark & (values > edges[-1])].sum())
    return AreaHistogram(
        pixels=total + counted.unknown,
        unknown=counted.unknown,
        too_dark=too_dark,
        limit=limit,
        below=total - too_dark - above - int(filled.sum()),
        above=above,
        edges=edges,
        counts=filled,
        mean=float(np.average(values, weights=counts)) if total else None,
        smallest=float(values[0]) if total else None,
        largest=float(values[-1]) if total else None,
        percentiles=tuple(
            _rank(values, counts, percent, pixels=total + counted.unknown, too_dark=too_dark)
            for percent in PERCENTS
        ),
    )


def _lay_edges(
    shown: Array,
    weights: NDArray[np.int64],
    *,
    logarithmic: bool,
    bins: int,
    ends: tuple[float | None, float | None],
) -> Array:
    low, high = ends
    if shown.size:
        top = np.searchsorted(np.cumsum(weights), _LINEAR_TOP * weights.sum())
        least = float(shown[0]) if logarithmic else min(0.0, float(shown[0]))
        low = least if low is None else low
        high = float(shown[-1] if logarithmic else shown[top]) if high is None else high
    low = low if low is not None else 0.1 if logarithmic else 0.0
    high = high if high is not None and high > low else (2.0 * low if low > 0.0 else low + 1.0)
    if not logarithmic:
        return np.linspace(low, high, bins + 1)
    edges = np.geomspace(low, high, bins + 1)
    edges[0], edges[-1] = low, high
    return edges


def _rank(
    values: Array, counts: NDArray[np.int64], percent: int, *, pixels: int, too_dark: int
) -> Percentile:
    """Find the smallest value that at least this share of all pixels does not exceed."""
    needed = max(1, math.ceil(percent / 100.0 * pixels - 1e-9))
    if needed <= too_dark:
        return Percentile(percent=percent, rank="too_dark", value=None)
    cumulated = np.cumsum(counts)
    if not cumulated.size or needed > cumulated[-1]:
        return Percentile(percent=percent, rank="unknown", value=None)
    return Percentile(percent=percent, rank="value", value=float(values[np.searchsorted(cumulated, needed)]))
