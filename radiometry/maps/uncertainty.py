"""Uncertainty of a map's values: the part that all pixels share, and each pixel's own."""

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from radiometry.frame.statistics import GREY

Array = NDArray[np.float64]

COVERAGE: Final = 2.0
"""Standard uncertainties below which a value is not distinguished from zero."""

_INDEPENDENT: Final = frozenset({"rgb", GREY})


@dataclass(frozen=True, kw_only=True)
class PixelUncertainty:
    """Uncertainty of values of a map.

    Attributes
    ----------
    relative : float or ndarray of float64
        Standard uncertainty as a share of the value: K, meter, time, f-number; of places, that of each.
    constant : float
        Standard uncertainty that is the same in every pixel, in the map's unit: dark signal, stray light.
    pixel : float
        Noise of a single pixel where the value is `reference`, in the map's unit.
    reference : float
        Mean of the region in which `pixel` was found.
    likeness : float
        Variance of the mean of many neighbouring pixels, times their number, over that of one: above 1 where
        pixels are made of the same raw values.
    """

    relative: float | Array
    constant: float
    pixel: float
    reference: float
    likeness: float = 1.0

    @property
    def limit(self) -> float:
        """Value that a single pixel must exceed to be distinguished from zero."""
        return COVERAGE * math.hypot(self.constant, self.pixel)

    def common(self, values: Array) -> Array:
        """Compute the part that all pixels share, which no mean reduces.

        Parameters
        ----------
        values : ndarray of float64
            Values.
        """
        return np.hypot(self.relative * values, self.constant)

    def own(self, values: Array, pixels: Array | float = 1.0) -> Array:
        """Compute an upper bound of the noise of values that are each the mean of some pixels.

        Parameters
        ----------
        values : ndarray of float64
            Values.
        pixels : ndarray of float64 or float, default: 1.0
            Number of different pixels that each is the mean of.

        Notes
        -----
        Noise of variance a + b v, with a and b not negative, grows at most as v: beyond the reference u^2 is
        that of the reference times v / reference, below it that of the reference.
        """
        above = np.maximum(1.0, values / self.reference) if self.reference > 0.0 else np.ones_like(values)
        return self.pixel * np.sqrt(above * np.minimum(1.0, self.likeness / pixels))


def find_likeness(cfa: str, channel: str) -> float:
    """Compute how much less a mean of a map's pixels averages than their number says.

    Parameters
    ----------
    cfa : str
        Pattern of the frame: "rgb", "grey", or four letters.
    channel : str
        Signal of the map.

    Returns
    -------
    float
        2 where half of the pixels are means of their green neighbours; 64 / 9 where each is a mean of 3 x 3
        with the weights 1 2 1; else 1.

    Notes
    -----
    The largest eigenvalue of the pixels' covariance over the variance of one pixel: the variance of an
    equally weighted mean of any n different pixels is at most that variance times it, over n.
    """
    if cfa in _INDEPENDENT or len(cfa) != 4:
        return 1.0
    return {"green": 2.0, GREY: (16.0 / 6.0) ** 2}.get(channel, 1.0)


def read_uncertainty(values: Any, *, reference: float, likeness: float) -> PixelUncertainty | None:  # noqa: ANN401
    """Return the uncertainty from the three figures of a map's answer.

    Parameters
    ----------
    values : object or None
        Has `u_rel`, `u_constant` and `u_pixel`; None of a map without a rule.
    reference : float
        Mean of the measured region.
    likeness : float
        As `find_likeness` returns it.
    """
    if values is None:
        return None
    return PixelUncertainty(
        relative=values.u_rel,
        constant=values.u_constant,
        pixel=values.u_pixel,
        reference=reference,
        likeness=likeness,
    )
