"""One lens at one f-number: V at every pixel and over regions, for a correction of luminance."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radiometry.fitting.evidence import Quantity
from radiometry.frame.roi import Polygon, Window, bounding_window, mask
from radiometry.vignetting.application import (
    bracket,
    evaluate_one,
    list_windows,
    require_format,
    spread_between,
)
from radiometry.vignetting.curve import Array, evaluate_curve
from radiometry.vignetting.results import Coefficient

_End = tuple[Coefficient, float, float, Array]  # with its weight, and at the place: V and its slopes


@dataclass(frozen=True, kw_only=True)
class LensShare:
    """V at a place or over a region, and the effect of each independent error of its calibration on it.

    Attributes
    ----------
    value : float
        V.
    effects : tuple of float
        Change of V by one standard uncertainty of each source, with its sign. At one
        f-number, for the same channels, the sources have one order: what two places
        share is the same error in both.
    """

    value: float
    effects: tuple[float, ...]

    @property
    def standard_uncertainty(self) -> float:
        """Standard uncertainty of the value, all sources together."""
        return math.hypot(*self.effects)

    @property
    def quantity(self) -> Quantity:
        """The share as it is reported."""
        return Quantity(value=self.value, standard_uncertainty=self.standard_uncertainty, unit="1")


@dataclass(frozen=True, kw_only=True)
class Lens:
    """Vignetting version at the f-number of a frame.

    Attributes
    ----------
    coefficients : tuple of Coefficient
        All coefficients of the version.
    f_number : float
        F-number.
    """

    coefficients: tuple[Coefficient, ...]
    f_number: float

    def require(self, *, channels: Sequence[str], height_px: int, width_px: int) -> None:
        """Check that the version is valid for frames of a format.

        Parameters
        ----------
        channels : sequence of str
            Channels that are needed.
        height_px, width_px : int
            Size of the frames [px].

        Raises
        ------
        InputRejected
            `vignetting_not_calibrated` for another picture size, channel or f-number.
        """
        require_format(self.coefficients, height_px=height_px, width_px=width_px)
        for channel in channels:
            bracket(self.coefficients, channel=channel, f_number=self.f_number)

    def over(self, polygon: Polygon, *, channels: Sequence[str]) -> LensShare:
        """Compute the mean of V over a region, averaged over channels.

        Parameters
        ----------
        polygon : Polygon
            Region.
        channels : sequence of str
            Channels that are averaged.

        Returns
        -------
        LensShare
            Mean V with its effects.

        Raises
        ------
        InputRejected
            `vignetting_not_calibrated`, `roi_outside_frame` or `roi_empty`.

        Notes
        -----
        The parameters' errors are shared by all pixels of the region: they enter by the mean of V's slopes.
        """
        return _combine(
            [
                [(each, weight, *average_curve(each, polygon)) for each, weight in self._bracket(channel)]
                for channel in channels
            ]
        )

    def at(self, row_px: int, col_px: int, *, channels: Sequence[str]) -> LensShare:
        """Compute V at one pixel's centre, averaged over channels.

        Parameters
        ----------
        row_px, col_px : int
            Row and column of the pixel.
        channels : sequence of str
            Channels that are averaged.

        Returns
        -------
        LensShare
            V with its effects.
        """
        row, col = np.array(float(row_px)), np.array(float(col_px))

        def resolve(channel: str) -> list[_End]:
            found = [(each, w, *evaluate_one(each, row, col)) for each, w in self._bracket(channel)]
            return [(each, weight, float(value), slopes) for each, weight, value, slopes in found]

        return _combine([resolve(channel) for channel in channels])

    def compute_plane(
        self, rows_px: NDArray[np.intp], cols_px: NDArray[np.intp], *, channel: str
    ) -> NDArray[np.float32]:
        """Compute V of a channel at rows and columns, without its uncertainty: a tenth of the work.

        Parameters
        ----------
        rows_px : ndarray of intp
            Rows of pixel centres [px], (n,).
        cols_px : ndarray of intp
            Columns of pixel centres [px], (m,).
        channel : str
            Name of the channel.

        Returns
        -------
        ndarray of float32
            V, (row, col).
        """
        plane = np.zeros((rows_px.size, cols_px.size))
        for coefficient, weight in self._bracket(channel):
            centre, radius = coefficient.centre_px, coefficient.radius_px
            squared = ((rows_px - centre[0]) / radius)[:, None] ** 2 + ((cols_px - centre[1]) / radius) ** 2
            plane += weight * evaluate_curve(squared, coefficient.k)
        return plane.astype(np.float32)

    def _bracket(self, channel: str) -> tuple[tuple[Coefficient, float], ...]:
        return bracket(self.coefficients, channel=channel, f_number=self.f_number)


def average_over_polygon(
    coefficients: Sequence[Coefficient], polygon: Polygon, *, channels: Sequence[str], f_number: float
) -> Quantity:
    """Compute the mean of V over a region, averaged over channels.

    A uniform surface's mean signal is divided by it.

    Parameters
    ----------
    coefficients : sequence of Coefficient
        Coefficients of one version.
    polygon : Polygon
        Region.
    channels : sequence of str
        Channels that are averaged.
    f_number : float
        F-number.

    Raises
    ------
    InputRejected
        `vignetting_not_calibrated`, as in `evaluate`; `roi_outside_frame`; `roi_empty`.

    Notes
    -----
    u^2 = sum over channels of J C J' / m^2 + (model term)^2 + (interpolation term)^2, J the mean of V's
    slopes over the region, since the parameters' errors are shared by all of its pixels. The model's and
    the interpolation's error are taken as alike in the whole region and in all channels: they do not
    average out.
    """
    return Lens(coefficients=tuple(coefficients), f_number=f_number).over(polygon, channels=channels).quantity


def average_curve(coefficient: Coefficient, polygon: Polygon) -> tuple[float, Array]:
    """Compute the means of V and of its slopes over a region's pixels, a band of rows at a time.

    Parameters
    ----------
    coefficient : Coefficient
        Falloff of one f-number and channel.
    polygon : Polygon
        Region.

    Returns
    -------
    tuple of (float, ndarray of float64)
        Mean V, and mean of its slopes.
    """
    whole = bounding_window(polygon, height_px=coefficient.height_px, width_px=coefficient.width_px)
    total, slopes_total, count = 0.0, np.zeros(len(coefficient.covariance)), 0
    for band in list_windows(whole.height, whole.width):
        window = Window(row0=whole.row0 + band.row0, col0=whole.col0, height=band.height, width=band.width)
        rows, cols = np.nonzero(mask(polygon, window))
        value, slopes = evaluate_one(
            coefficient, (rows + window.row0).astype(np.float64), (cols + window.col0).astype(np.float64)
        )
        total += float(value.sum())
        slopes_total += slopes.sum(axis=1)
        count += rows.size
    return total / count, slopes_total / count


def _combine(channels: Sequence[Sequence[_End]]) -> LensShare:
    """Average over channels and between f-numbers; correlated parameters as independent combinations."""
    count = len(channels)
    value = model = between = 0.0
    effects: list[float] = []
    for ends in channels:
        for coefficient, weight, mean, slopes in ends:
            value += weight * mean / count
            model += weight * coefficient.model_u_rel * mean / count
            variances, directions = np.linalg.eigh(np.array(coefficient.covariance))
            combined = slopes @ (directions * np.sqrt(np.maximum(variances, 0.0)))
            effects += (weight / count * combined).tolist()
        if len(ends) == 2:
            between += spread_between(ends[1][1]) * (ends[1][2] - ends[0][2]) / count
    return LensShare(value=value, effects=(*effects, model, between))
