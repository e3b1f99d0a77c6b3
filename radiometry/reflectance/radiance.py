"""Radiance of a region, by the calibration that the manufacturer wrote into the file."""

from dataclasses import dataclass

from radiometry.findings import Raised, shared
from radiometry.fitting.evidence import Quantity
from radiometry.frame import Frame, FrameHeader
from radiometry.frame.exposure import Exposure
from radiometry.frame.roi import Polygon, Window, mask
from radiometry.reflectance import codes
from radiometry.reflectance.features import extract_features
from radiometry.reflectance.imaging import RADIANCE_UNIT, compute_signal, require_band, signal_unit
from radiometry.reflectance.measurement import Percentile, describe_pixels, estimate_noise
from radiometry.reflectance.points import MOST_SATURATED_SHARE


@dataclass(frozen=True, kw_only=True)
class MeasuredRadiance:
    """Radiance of a region by the manufacturer's calibration; nothing is clipped.

    Attributes
    ----------
    radiance : str
        Name of the band.
    pixels : int
        Number of pixels.
    mean : Quantity
        Radiance of the region's signal, with its noise alone as uncertainty [W/(m2 sr nm)].
    smallest, largest, median : Quantity
        Statistics as in `MeasuredReflectance`.
    percentiles : tuple of Percentile
        Percentiles of single pixels.
    saturated_share : float
        Saturated fraction of the region, 0 to 1.
    flags : tuple of Raised
        Flags of the measurement.
    """

    radiance: str
    pixels: int
    mean: Quantity
    smallest: Quantity
    largest: Quantity
    median: Quantity
    percentiles: tuple[Percentile, ...]
    saturated_share: float
    flags: tuple[Raised, ...]


def require_radiance(header: FrameHeader) -> None:
    """Refuse a band whose file states no absolute calibration.

    Parameters
    ----------
    header : FrameHeader
        Metadata of the frame.

    Raises
    ------
    InputRejected
        `radiance_unknown`.
    """
    band = require_band(header)
    if signal_unit(band) != RADIANCE_UNIT:
        raise codes.RADIANCE_UNKNOWN.refuse(
            f"Band {band.band_name} of {header.model or 'this camera'} has a signal of unknown scale."
        )


def measure_radiance(
    frame: Frame, polygon: Polygon, *, header: FrameHeader, exposure: Exposure
) -> MeasuredRadiance:
    """Measure the radiance of a region, L = V(x, y) a1 / (g (t + a2 y - a3 t y)) (p - B) [1]_.

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

    Returns
    -------
    MeasuredRadiance
        Radiance. Flags: `radiance_uncertainty_unknown` and `saturated`.

    Raises
    ------
    InputRejected
        `radiance_unknown`, and those of `extract_features`.

    References
    ----------
    .. [1] MicaSense, "RedEdge Camera Radiometric Calibration Model"
    """
    require_radiance(header)
    features = extract_features(frame, polygon, header=header, exposure=exposure)
    signal = compute_signal(frame, header=header, settings=exposure.on_basis("nominal"))
    height, width = signal.shape
    inside = mask(polygon, Window(row0=frame.row0, col0=frame.col0, height=height, width=width))
    flags = [codes.RADIANCE_UNCERTAINTY_UNKNOWN.at("", "Only the noise of the pixels is stated.")]
    share = features.statistics.saturated_share
    if share > MOST_SATURATED_SHARE:
        flags.append(shared.SATURATED.at("", f"{share:.2%} of the samples."))
    noise = estimate_noise(signal, inside)
    return MeasuredRadiance(
        radiance=features.band,
        mean=Quantity(
            value=features.i_sq,
            standard_uncertainty=features.i_sq_standard_uncertainty,
            unit=RADIANCE_UNIT,
        ),
        **describe_pixels(signal[inside], noise=noise, shared_rel=0.0, unit=RADIANCE_UNIT),
        saturated_share=share,
        flags=tuple(flags),
    )
