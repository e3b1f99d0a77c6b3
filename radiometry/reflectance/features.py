"""Features of a region of one band: raw statistics, and irradiance or radiance."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected, shared
from radiometry.frame import Frame, FrameHeader
from radiometry.frame.exposure import Exposure
from radiometry.frame.roi import Polygon, Window, mask
from radiometry.frame.statistics import ChannelStatistics, compute_statistics
from radiometry.reflectance.imaging import compute_signal, find_black_dn, require_band, signal_unit

_CONTAINER_BITS = 16


@dataclass(frozen=True, kw_only=True)
class Features:
    """A region of one band, ready for JSON.

    Attributes
    ----------
    band : str
        Name of the band.
    statistics : ChannelStatistics
        Statistics of raw values, black included, with the band as channel.
    i_sq : float
        Mean over the region after black and vignetting: a Sequoia's irradiance
        [unit of its own], a MicaSense camera's radiance [W/(m2*sr*nm)] or a DJI
        camera's rate [1/s].
    i_sq_standard_uncertainty : float
        Standard uncertainty of the mean, from pixel noise and rounding.
    i_sq_std : float
        Standard deviation over the region's pixels.
    i_sq_unit : str
        Unit of the three.
    gradient_rel : float
        Range of the plane that fits the region best, relative to the mean.
    """

    band: str
    statistics: ChannelStatistics
    i_sq: float
    i_sq_standard_uncertainty: float
    i_sq_std: float
    i_sq_unit: str
    gradient_rel: float


def extract_features(frame: Frame, polygon: Polygon, *, header: FrameHeader, exposure: Exposure) -> Features:
    """Compute the features of a region.

    Parameters
    ----------
    frame : Frame
        Window that contains the region's window.
    polygon : Polygon
        Region.
    header : FrameHeader
        Metadata of the frame.
    exposure : Exposure
        Exposure of the frame.

    Raises
    ------
    InputRejected
        `roi_empty` or `sensor_model_unusable`.

    Notes
    -----
    With s the standard deviation of the pixels and q the sensor's step (64 raw
    values in the file of a Sequoia or DJI camera, 16 in a MicaSense camera's), the
    variance of the mean is::

        u^2 = s^2 / n + (q^2 / 12) exp(-4 pi^2 s^2 / q^2)
    """
    band = require_band(header)
    height, width = frame.samples_dn.shape[:2]
    inside = mask(polygon, Window(row0=frame.row0, col0=frame.col0, height=height, width=width))
    if not inside.any():
        raise InputRejected(shared.ROI_EMPTY, "The region holds no pixel of this window of the frame.")
    (statistics,) = compute_statistics(frame, inside)
    signal = compute_signal(frame, header=header, settings=exposure.on_basis("nominal"))
    values = signal[inside]
    mean, std = float(values.mean()), float(values.std(ddof=1)) if values.size > 1 else 0.0
    light_dn = statistics.mean_dn - find_black_dn(band, header.black_level_dn)
    per_dn = abs(mean / light_dn) if light_dn else 0.0
    step = _step_dn(header) * per_dn
    kept = math.exp(-4.0 * math.pi**2 * (std / step) ** 2) * step**2 / 12.0 if step > 0.0 else 0.0
    return Features(
        band=band.band,
        statistics=replace(statistics, channel=band.band),
        i_sq=mean,
        i_sq_standard_uncertainty=math.sqrt(std**2 / values.size + kept),
        i_sq_std=std,
        i_sq_unit=signal_unit(band),
        gradient_rel=measure_gradient(signal, inside),
    )


def measure_gradient(signal: NDArray[np.float64], inside: NDArray[np.bool_]) -> float:
    """Compute the change of a region's signal across it: a plane's range, relative to the mean.

    Parameters
    ----------
    signal : ndarray of float64
        Signal, (row, col).
    inside : ndarray of bool
        Pixels of the region in the same window, (row, col).

    Returns
    -------
    float
        Range relative to the mean; 0 if the region is too narrow for a plane.

    Notes
    -----
    The plane is the least-squares one through all pixels, so noise has little
    effect: over n pixels of noise s the range that noise produces is about 2
    sqrt(12) s / sqrt(n).
    """
    rows, cols = np.nonzero(inside)
    values = signal[inside]
    mean = float(values.mean())
    design = np.column_stack((rows - rows.mean(), cols - cols.mean()))
    moments = design.T @ design
    if values.size < 3 or mean == 0.0 or np.linalg.cond(moments) > 1e12:
        return 0.0
    slopes = np.linalg.solve(moments, design.T @ (values - mean))
    return float(np.ptp(design @ slopes) / abs(mean))


def _step_dn(header: FrameHeader) -> float:
    """Return the step between the values that a sensor of fewer bits writes into sixteen."""
    full = require_band(header).full_scale_dn
    return 1.0 if full is None else float(1 << _CONTAINER_BITS) - full
