"""Signal of a band, whichever camera wrote it: black, then vignetting, then scale; and features of a region.

Which stages apply follows from the parts that the normalised band has, and not from the camera's name.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import NDArray

from radiometry.frame import Frame, FrameHeader, multispectral
from radiometry.frame.exposure import Exposure, Settings
from radiometry.frame.roi import Polygon, Window, mask, require_pixels
from radiometry.frame.statistics import ChannelStatistics, compute_statistics
from radiometry.records import Record
from radiometry.reflectance import codes

Plane = NDArray[np.float64]

_DARKEST_SHARE, _BRIGHTEST_SHARE = 0.05, 2.0
_PROBES = 33
# Some firmware wrote 1/6329 s for exposures of 0.274 ms.
_MISWRITTEN_TIME_S, _MEANT_TIME_S = 1.0 / 6329.0, 0.000274
_ISO_PER_GAIN = 100.0
SEQUOIA_UNIT = "1"
RADIANCE_UNIT = "W/(m2*sr*nm)"
DJI_UNIT = "1/s"
_CONTAINER_BITS = 16


class FrameSize(Record):
    """Size of the whole visible area."""

    height_px: int
    width_px: int


def evaluate_polynomial(
    lens: multispectral.VignettingPolynomial, window: Window, *, size: FrameSize
) -> Plane:
    """Compute V(x/W, y/H) = sum c_n (x/W)^i_n (y/H)^j_n in a window of a frame of W x H pixels.

    x is a pixel's column and y its row, counted from 0. What leaves 5 % to 200 % is not a lens's polynomial.
    """
    return _require_lens(_evaluate(lens, *_pixels(window), size=size))


def evaluate_band(band: multispectral.Multispectral, window: Window, *, size: FrameSize) -> Plane:
    """Compute the relative illumination V of a band in a window, in whichever form its file states it."""
    return _require_lens(_illuminate(band, *_pixels(window), size=size))


def require_lens(band: multispectral.Multispectral, *, size: FrameSize) -> None:
    """Refuse a relative illumination that is not a lens's somewhere in the frame."""
    x, y = (np.linspace(0.0, length - 1.0, _PROBES) for length in (size.width_px, size.height_px))
    _require_lens(_illuminate(band, x, y, size=size))


def _pixels(window: Window) -> tuple[Plane, Plane]:
    x = np.arange(window.col0, window.col0 + window.width, dtype=np.float64)
    return x, np.arange(window.row0, window.row0 + window.height, dtype=np.float64)


def _illuminate(band: multispectral.Multispectral, x: Plane, y: Plane, *, size: FrameSize) -> Plane:
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        if band.vignetting_polynomial is not None:
            return _evaluate(band.vignetting_polynomial, x, y, size=size)
        if band.radial_vignetting is not None:
            return _evaluate_radial(band.radial_vignetting, x, y)
        if band.radial_gain is not None:
            return 1.0 / _evaluate_radial(band.radial_gain, x, y)
    raise codes.SENSOR_MODEL_UNUSABLE.reject(
        f"The file of band {band.band_name} has no readable vignetting polynomial. Use the camera's original "
        "file and its newest firmware."
    )


def _evaluate(lens: multispectral.VignettingPolynomial, x: Plane, y: Plane, *, size: FrameSize) -> Plane:
    highest = np.max(np.array(lens.exponents), axis=0)
    terms = np.zeros(highest + 1)
    for (power_x, power_y), coefficient in zip(lens.exponents, lens.coefficients, strict=True):
        terms[power_x, power_y] += coefficient
    of_each_row = np.asarray(polynomial.polyval(y / size.height_px, terms.T), np.float64)  # (power of x, row)
    return _sum_powers(x / size.width_px, of_each_row[:, :, None], (len(y), len(x)))


def _evaluate_radial(lens: multispectral.RadialVignetting, x: Plane, y: Plane) -> Plane:
    radius = np.hypot((y - lens.centre_y_px)[:, None], (x - lens.centre_x_px)[None, :])
    return _sum_powers(radius, np.array([1.0, *lens.coefficients]), radius.shape)


def _sum_powers(base: Plane, coefficients: Plane, shape: tuple[int, ...]) -> Plane:
    """Compute c_0 + c_1 base + c_2 base^2 + ... by Horner's rule, in one plane.

    The values equal those of numpy's polyval to the last bit; polyval makes two new
    planes for each term and is three times slower on a million pixels.
    """
    total = np.broadcast_to(coefficients[-1], shape).copy()
    for coefficient in coefficients[-2::-1]:
        total *= base
        total += coefficient
    return total


def _require_lens(share: Plane) -> Plane:
    darkest, brightest = float(share.min()), float(share.max())
    if not (darkest >= _DARKEST_SHARE and brightest <= _BRIGHTEST_SHARE):
        raise codes.SENSOR_MODEL_UNUSABLE.reject(
            f"The file's vignetting polynomial gives a relative illumination of {darkest:.3g} to "
            f"{brightest:.3g}: it is not a lens's. Use the camera's original file."
        )
    return share


def scale_to_irradiance(signal_dn: Plane, *, model: multispectral.SensorModel, settings: Settings) -> Plane:
    """Compute I_sq = f^2 signal / (A eps gamma + C) of a Sequoia's signal (p - B) / V.

    eps is the exposure time [s], gamma the ISO value. I_sq is in a unit of its own, the same for all bands of
    all captures of one camera; K carries its scale. Parrot, SEQ-AN-01 (sensor model) and its vignetting note;
    "How to convert Sequoia images to reflectance?" 1.1, section 4.
    """
    response = model.a * settings.exposure_time_s * settings.iso + model.c
    if not response > 0.0:
        raise codes.SENSOR_MODEL_UNUSABLE.reject(
            f"The file's SensorModel {model.a:g}, {model.b:g}, {model.c:g} has no positive response at "
            f"{settings.exposure_time_s:g} s and ISO {settings.iso:g}. Use the camera's original file."
        )
    return signal_dn * (settings.f_number**2 / response)


def scale_to_radiance(
    signal: Plane, *, model: multispectral.RadianceModel, settings: Settings, row0: int
) -> Plane:
    """Compute the radiance of a MicaSense camera's signal V(r) (p - p_BL) / 2^bits [W/m2/sr/nm].

        L = V(r) (a1/g) (p - p_BL) / (te + a2 y - a3 te y)          p, p_BL as fractions of 2^bits

    te is the exposure time [s], g the gain (ISO/100), y the row, V = 1 / (1 + k0 r + k1 r^2 + ... + k5 r^6),
    r [px] from the vignetting centre. MicaSense, "RedEdge Camera Radiometric Calibration Model"; its public
    library uses the same model, with the same values for the same files.
    """
    time_s = settings.exposure_time_s
    if math.isclose(time_s, _MISWRITTEN_TIME_S, abs_tol=1e-6):
        time_s = _MEANT_TIME_S
    row = np.arange(row0, row0 + signal.shape[0])
    exposure_s = time_s + model.a2 * row - model.a3 * time_s * row
    if not exposure_s.min() > 0.0:
        raise codes.SENSOR_MODEL_UNUSABLE.reject(
            "The file's RadiometricCalibration leaves rows of the image without exposure. "
            "Use the camera's original file."
        )
    gain = settings.iso / _ISO_PER_GAIN
    return signal * (model.a1 / gain) / exposure_s[:, None]


def scale_to_rate(signal: Plane, *, model: multispectral.GainModel) -> Plane:
    """Compute a DJI camera's rate of a signal, which is proportional to radiance [1/s].

        camera = G(r) (p - p_BL) p_cam / (gain t)          p, p_BL as fractions of 2^bits

    t is the exposure time [s], gain and p_cam are `SensorGain` and `SensorGainAdjustment`, G = 1 + k0 r + k1
    r^2 + ... + k5 r^6 with r [px] from the calibrated optical centre. DJI's reflectance is camera /
    `Irradiance` times a panel's factor, which is K. "P4 Multispectral Image Processing Guide" 1.0, equations
    7 to 9, which divides by 65535 where the "Mavic 3M Image Processing Guide" 1.0 divides by 2^bits: 1.5e-5
    apart, and K takes it up.
    """
    if not min(model.gain, model.exposure_time_s, model.adjustment) > 0.0:
        raise codes.SENSOR_MODEL_UNUSABLE.reject(
            f"The file's SensorGain {model.gain:g}, ExposureTime {model.exposure_time_s * 1e6:g} us and "
            f"SensorGainAdjustment {model.adjustment:g} are no camera's. Use the camera's original file."
        )
    return signal * (model.adjustment / (model.gain * model.exposure_time_s))


def require_band(header: FrameHeader) -> multispectral.Multispectral:
    """Return the metadata of a band that has a reflectance."""
    band = header.multispectral
    if band is None:
        name = " ".join(filter(None, (header.make, header.model))) or "of an unknown make"
        raise codes.SENSOR_MODEL_UNUSABLE.reject(
            f"The camera {name} does not say which band the file holds nor how its sensor responds. "
            f"Reflectance works with original files of {'; '.join(multispectral.CAMERAS.values())}. If the "
            "camera is one of these, the file's XMP was lost or damaged: upload the file that the camera "
            "wrote."
        )
    if band.kind is not None:
        raise codes.SENSOR_MODEL_UNUSABLE.reject(describe_kind(band))
    if band.problem is not None or band.response is None:
        what = band.problem or "its response is missing"
        raise codes.SENSOR_MODEL_UNUSABLE.reject(
            f"The file of band {band.band_name} has no readable sensor model or lens: {what}. Use the "
            "camera's original file and its newest firmware."
        )
    return band


def describe_kind(band: multispectral.Multispectral) -> str:
    """Describe why a thermal or panchromatic band has no reflectance."""
    why = {"thermal": "emitted heat, not reflected light", "panchromatic": "one wide range of wavelengths"}
    seen = why.get(band.kind or "", "")
    return f"Band {band.band_name} is {band.kind} and shows {seen}: the reflectance method leaves it out."


def inspect_band(header: FrameHeader, settings: Settings) -> None:
    """Refuse a band whose signal could not be computed somewhere in the frame, without its pixels."""
    band = require_band(header)
    require_lens(band, size=FrameSize(height_px=header.height_px, width_px=header.width_px))
    scaled = _scale(np.ones((header.height_px, 1)), band.response, settings, row0=0)
    black_dn, white_dn = find_black_dn(band, header.black_level_dn), min(header.white_level_dn)
    if not (np.isfinite(scaled).all() and 0.0 <= black_dn < white_dn):
        raise codes.SENSOR_MODEL_UNUSABLE.reject(
            f"Band {band.band_name} has a black level of {black_dn:g} DN below a white level of "
            f"{white_dn:g} DN, and its response gives {float(scaled[0, 0]):g} for one: that is no sensor's. "
            "Use the camera's original file."
        )


def find_black_dn(band: multispectral.Multispectral, levels_dn: Sequence[float]) -> float:
    if band.sensor_model is not None:
        return band.sensor_model.b
    return sum(levels_dn) / len(levels_dn) if band.black_dn is None else band.black_dn


def signal_unit(band: multispectral.Multispectral) -> str:
    if isinstance(band.response, multispectral.SensorModel):
        return SEQUOIA_UNIT
    return RADIANCE_UNIT if isinstance(band.response, multispectral.RadianceModel) else DJI_UNIT


def compute_signal(frame: Frame, *, header: FrameHeader, settings: Settings) -> Plane:
    """Compute I_sq, or radiance, of every pixel of a window; nothing is clipped.

    The position in the frame enters: the signal of a window equals that of the whole frame there, to the last
    bit. Black does not come through the lens, so it must be subtracted BEFORE the division by V: p / V - B is
    too large by B (1/V - 1), in the top left corner of a real capture 4 % (green) to 19 % (red edge) of the
    signal.
    """
    band = require_band(header)
    black_dn = find_black_dn(band, header.black_level_dn)
    signal = np.subtract(frame.samples_dn, black_dn, dtype=np.float64)
    if not isinstance(band.response, multispectral.SensorModel):
        signal /= float(1 << header.bits_per_sample)
    size = FrameSize(height_px=frame.height_px, width_px=frame.width_px)
    signal /= evaluate_band(band, frame.window, size=size)
    return _scale(signal, band.response, settings, row0=frame.row0)


def _scale(signal: Plane, response: multispectral.Response | None, settings: Settings, *, row0: int) -> Plane:
    if isinstance(response, multispectral.SensorModel):
        return scale_to_irradiance(signal, model=response, settings=settings)
    if isinstance(response, multispectral.RadianceModel):
        return scale_to_radiance(signal, model=response, settings=settings, row0=row0)
    assert response is not None  # noqa: S101  `require_band` refused a band without one
    return scale_to_rate(signal, model=response)


class Features(Record):
    """A region of one band, ready for JSON."""

    band: str
    statistics: ChannelStatistics  # of raw values, black included, with the band as channel
    i_sq: float  # mean over the region after black and vignetting, in the unit of `compute_signal`
    i_sq_standard_uncertainty: float  # of the mean, from pixel noise and rounding
    i_sq_std: float  # over the region's pixels
    i_sq_unit: str
    gradient_rel: float  # range of the plane that fits the region best, relative to the mean


def extract_features(frame: Frame, polygon: Polygon, *, header: FrameHeader, exposure: Exposure) -> Features:
    """Compute the features of a region.

    With s the standard deviation of the pixels and q the sensor's step (64 raw values in the file of a
    Sequoia or DJI camera, 16 in a MicaSense camera's), the variance of the mean is::

        u^2 = s^2 / n + (q^2 / 12) exp(-4 pi^2 s^2 / q^2)
    """
    band = require_band(header)
    inside = require_pixels(mask(polygon, frame.window))
    (statistics,) = compute_statistics(frame, inside)
    signal = compute_signal(frame, header=header, settings=exposure.on_basis("nominal"))
    values = signal[inside]
    mean, std = float(values.mean()), float(values.std(ddof=1)) if values.size > 1 else 0.0
    light_dn = statistics.mean_dn - find_black_dn(band, header.black_level_dn)
    per_dn = abs(mean / light_dn) if light_dn else 0.0
    # the step between the values that a sensor of fewer bits writes into sixteen
    full = band.full_scale_dn
    step = (1.0 if full is None else float(1 << _CONTAINER_BITS) - full) * per_dn
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

    The plane is the least-squares one through all pixels, so noise has little effect: over n pixels of noise
    s the range that noise produces is about 2 sqrt(12) s / sqrt(n).
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
