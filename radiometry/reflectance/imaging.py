"""Signal of a band's pixels, whichever camera wrote them: black, then vignetting, then scale."""

from typing import assert_never

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected
from radiometry.frame import Frame, FrameHeader
from radiometry.frame.exposure import Settings
from radiometry.frame.multispectral import Multispectral
from radiometry.frame.roi import Window
from radiometry.reflectance import codes, micasense, sequoia
from radiometry.reflectance.lens import FrameSize, correct_vignetting, evaluate_polynomial, evaluate_radial

Plane = NDArray[np.float64]

SEQUOIA_UNIT = "1"
RADIANCE_UNIT = "W/(m2*sr*nm)"


def require_band(header: FrameHeader) -> Multispectral:
    """Return the metadata of the band of a multispectral file.

    Parameters
    ----------
    header : FrameHeader
        Metadata of the file.

    Returns
    -------
    Multispectral
        Metadata of the band.

    Raises
    ------
    InputRejected
        `sensor_model_unusable` if the file is of another kind.
    """
    if header.multispectral is None:
        raise InputRejected(
            codes.SENSOR_MODEL_UNUSABLE,
            "The file does not say which band it holds nor how its sensor responds: it is not an original "
            "file of a Sequoia, RedEdge or Altum, or its XMP was lost or damaged. Upload the camera's own "
            "file.",
        )
    return header.multispectral


def signal_unit(band: Multispectral) -> str:
    """Return the unit of a band's signal.

    Parameters
    ----------
    band : Multispectral
        Metadata of the band.

    Returns
    -------
    str
        A Sequoia's is its own, a MicaSense camera's is that of radiance.
    """
    return SEQUOIA_UNIT if band.system == "sequoia" else RADIANCE_UNIT


def compute_signal(frame: Frame, *, header: FrameHeader, settings: Settings) -> Plane:
    """Compute I_sq, or radiance, of every pixel of a window; nothing is clipped.

    Parameters
    ----------
    frame : Frame
        Window of the frame.
    header : FrameHeader
        Metadata of the frame.
    settings : Settings
        Exposure settings.

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
    match band.system:
        case "sequoia":
            return _compute_sequoia(frame, band, settings)
        case "micasense":
            return _compute_micasense(frame, band, settings, header.bits_per_sample)
        case _:
            assert_never(band.system)


def _compute_sequoia(frame: Frame, band: Multispectral, settings: Settings) -> Plane:
    if band.sensor_model is None or band.vignetting_polynomial is None:
        raise _lacks("SensorModel or VignettingPolynomial2D", band)
    light = sequoia.subtract_black(frame.samples_dn, black_dn=band.sensor_model.b)
    size = FrameSize(height_px=frame.height_px, width_px=frame.width_px)
    share = evaluate_polynomial(band.vignetting_polynomial, _window(frame), size=size)
    even = correct_vignetting(light, share)
    return sequoia.scale_to_irradiance(even, model=band.sensor_model, settings=settings)


def _compute_micasense(frame: Frame, band: Multispectral, settings: Settings, bits: int) -> Plane:
    if band.radiance_model is None or band.radial_vignetting is None:
        raise _lacks("RadiometricCalibration or VignettingPolynomial", band)
    black_dn = sum(frame.black_level_dn) / len(frame.black_level_dn)
    light = micasense.subtract_black(frame.samples_dn, black_dn=black_dn, bits=bits)
    even = correct_vignetting(light, evaluate_radial(band.radial_vignetting, _window(frame)))
    return micasense.scale_to_radiance(even, model=band.radiance_model, settings=settings, row0=frame.row0)


def _window(frame: Frame) -> Window:
    height, width = frame.samples_dn.shape
    return Window(row0=frame.row0, col0=frame.col0, height=height, width=width)


def _lacks(what: str, band: Multispectral) -> InputRejected:
    return InputRejected(
        codes.SENSOR_MODEL_UNUSABLE,
        f"The file of band {band.band_name} has no readable {what}: its numbers cannot become irradiance. "
        "Thermal bands have none; for others use the camera's original file and its newest firmware.",
    )
