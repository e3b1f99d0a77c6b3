"""Signal of a band's pixels, whichever camera wrote them: black, then vignetting, then scale.

Which stages apply follows from the parts that the normalised band has, and not from
the camera's name.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected
from radiometry.frame import Frame, FrameHeader
from radiometry.frame.exposure import Settings
from radiometry.frame.multispectral import CAMERAS, Multispectral, RadianceModel, Response, SensorModel
from radiometry.frame.roi import Window
from radiometry.reflectance import codes, dji, micasense, sequoia
from radiometry.reflectance.lens import FrameSize, correct_vignetting, evaluate_band, require_lens

Plane = NDArray[np.float64]

SEQUOIA_UNIT = "1"
RADIANCE_UNIT = "W/(m2*sr*nm)"
DJI_UNIT = "1/s"


def require_band(header: FrameHeader) -> Multispectral:
    """Return the metadata of a band that has a reflectance.

    Returns
    -------
    Multispectral
        Metadata of the band, with a response.

    Raises
    ------
    InputRejected
        `sensor_model_unusable` if the camera is none whose bands are read, the band is
        thermal or panchromatic, or the file states no usable response.
    """
    band = header.multispectral
    if band is None:
        name = " ".join(filter(None, (header.make, header.model))) or "of an unknown make"
        raise InputRejected(
            codes.SENSOR_MODEL_UNUSABLE,
            f"The camera {name} does not say which band the file holds nor how its sensor responds. "
            f"Reflectance works with original files of {'; '.join(CAMERAS.values())}. If the camera is one "
            "of these, the file's XMP was lost or damaged: upload the file that the camera wrote.",
        )
    if band.kind is not None:
        raise InputRejected(codes.SENSOR_MODEL_UNUSABLE, describe_kind(band))
    if band.problem is not None or band.response is None:
        what = band.problem or "its response is missing"
        raise InputRejected(
            codes.SENSOR_MODEL_UNUSABLE,
            f"The file of band {band.band_name} has no readable sensor model or lens: {what}. Use the "
            "camera's original file and its newest firmware.",
        )
    return band


def describe_kind(band: Multispectral) -> str:
    """Describe why a thermal or panchromatic band has no reflectance.

    Returns
    -------
    str
        Sentence for the person who supplied the file.
    """
    why = {"thermal": "emitted heat, not reflected light", "panchromatic": "one wide range of wavelengths"}
    seen = why.get(band.kind or "", "")
    return f"Band {band.band_name} is {band.kind} and shows {seen}: the reflectance method leaves it out."


def inspect_band(header: FrameHeader, settings: Settings) -> None:
    """Refuse a band whose signal could not be computed somewhere in the frame, without its pixels.

    Raises
    ------
    InputRejected
        `sensor_model_unusable`.
    """
    band = require_band(header)
    require_lens(band, size=FrameSize(height_px=header.height_px, width_px=header.width_px))
    scaled = _scale(np.ones((header.height_px, 1)), _response(band), settings, row0=0)
    black_dn, white_dn = find_black_dn(band, header.black_level_dn), min(header.white_level_dn)
    if not (np.isfinite(scaled).all() and 0.0 <= black_dn < white_dn):
        raise InputRejected(
            codes.SENSOR_MODEL_UNUSABLE,
            f"Band {band.band_name} has a black level of {black_dn:g} DN below a white level of "
            f"{white_dn:g} DN, and its response gives {float(scaled[0, 0]):g} for one: that is no sensor's. "
            "Use the camera's original file.",
        )


def find_black_dn(band: Multispectral, levels_dn: Sequence[float]) -> float:
    """Return the black level of a band.

    Parameters
    ----------
    band : Multispectral
        Metadata of the band.
    levels_dn : sequence of float
        Black levels of the file's tag [DN].

    Returns
    -------
    float
        SensorModel's B, else the level that the camera states for the band, else the
        mean of the tag's [DN].
    """
    if band.sensor_model is not None:
        return band.sensor_model.b
    return sum(levels_dn) / len(levels_dn) if band.black_dn is None else band.black_dn


def signal_unit(band: Multispectral) -> str:
    """Return the unit of a band's signal.

    Returns
    -------
    str
        A Sequoia's is its own, a MicaSense camera's is that of radiance, a DJI's is 1/s.
    """
    if isinstance(band.response, SensorModel):
        return SEQUOIA_UNIT
    return RADIANCE_UNIT if isinstance(band.response, RadianceModel) else DJI_UNIT


def compute_signal(frame: Frame, *, header: FrameHeader, settings: Settings) -> Plane:
    """Compute I_sq, or radiance, of every pixel of a window; nothing is clipped.

    Returns
    -------
    Plane
        Signal, (row, col).

    Raises
    ------
    InputRejected
        `sensor_model_unusable`.

    Notes
    -----
    The position in the frame enters: the signal of a window equals that of the
    whole frame there, to the last bit.
    """
    band = require_band(header)
    response, black_dn = _response(band), find_black_dn(band, header.black_level_dn)
    light = (
        sequoia.subtract_black(frame.samples_dn, black_dn=black_dn)
        if isinstance(response, SensorModel)
        else micasense.subtract_black(frame.samples_dn, black_dn=black_dn, bits=header.bits_per_sample)
    )
    height, width = frame.samples_dn.shape
    window = Window(row0=frame.row0, col0=frame.col0, height=height, width=width)
    size = FrameSize(height_px=frame.height_px, width_px=frame.width_px)
    even = correct_vignetting(light, evaluate_band(band, window, size=size))
    return _scale(even, response, settings, row0=frame.row0)


def _response(band: Multispectral) -> Response:
    assert band.response is not None  # noqa: S101  `require_band` refused a band without one
    return band.response


def _scale(signal: Plane, response: Response, settings: Settings, *, row0: int) -> Plane:
    if isinstance(response, SensorModel):
        return sequoia.scale_to_irradiance(signal, model=response, settings=settings)
    if isinstance(response, RadianceModel):
        return micasense.scale_to_radiance(signal, model=response, settings=settings, row0=row0)
    return dji.scale_to_rate(signal, model=response)
