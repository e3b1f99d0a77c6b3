"""Flicker of a lamp on the mains: the error of an exposure that is no whole number of periods."""

import math

from radiometry.findings import Raised
from radiometry.fitting.evidence import FieldCorrection
from radiometry.fitting.sources import FLICKER
from radiometry.frame.exposure import Settings
from radiometry.luminance import codes
from radiometry.luminance.conditions import FieldConditions

_MAINS_HZ = (50.0, 60.0)
_NAMED_FLICKER = 0.005
# rms of a modulation that may be anything from 0 to 1
_UNKNOWN_MODULATION = 1.0 / math.sqrt(3.0)


def correct_flicker(
    field: FieldConditions, settings: Settings, *, frames: int
) -> tuple[FieldCorrection, tuple[Raised, ...]]:
    """Estimate the error of an exposure that is no whole number of flicker periods.

    Parameters
    ----------
    field : FieldConditions
        Conditions of the measurement.
    settings : Settings
        Exposure of the frame.
    frames : int
        Number of frames that are averaged.

    Returns
    -------
    tuple[FieldCorrection, tuple of Raised]
        Correction without a factor, and `flicker_unknown` where the mains frequency is assumed.

    Notes
    -----
    See `compute_flicker`; the phase at which an exposure begins is random, so that the rms over it counts,
    and averages over frames. An unknown mains frequency is taken as that of 50 and 60 Hz which errs more.
    """
    mains, depth = field.mains_frequency_hz, field.flicker_modulation
    frequencies = _MAINS_HZ if mains is None else (mains,)
    largest, one = (
        max(found)
        for found in zip(
            *(estimate_flicker(settings.exposure_time_s, each, modulation=depth) for each in frequencies),
            strict=True,
        )
    )
    u_rel = one / math.sqrt(frames)
    supply = "assumed: mains frequency of 50 or 60 Hz" if mains is None else f"{mains:g} Hz mains"
    basis = f"{supply}, modulation {'assumed from 0 to 1' if depth is None else f'{depth:g}'}"
    assumed = True if mains is None or depth is None else None
    line = FieldCorrection(source=FLICKER, u_rel=u_rel, basis=basis, assumed=assumed)
    if mains is not None or u_rel <= _NAMED_FLICKER:
        return line, ()
    detail = f"At {settings.exposure_time_s:g} s, light of 50 or 60 Hz mains can err by {largest:.1%}."
    return line, (codes.FLICKER_UNKNOWN.at("", detail),)


def estimate_flicker(
    exposure_time_s: float, mains_frequency_hz: float, *, modulation: float | None
) -> tuple[float, float]:
    """Return the largest relative error of an exposure under fully modulated light, and its rms.

    Parameters
    ----------
    exposure_time_s, mains_frequency_hz : float
        As in `compute_flicker`.
    modulation : float or None
        Modulation depth; None for anything from 0 to 1.

    Returns
    -------
    tuple of float
        Largest error, and the rms over all phases at the modulation.
    """
    largest = compute_flicker(exposure_time_s, mains_frequency_hz=mains_frequency_hz)
    return largest, (_UNKNOWN_MODULATION if modulation is None else modulation) * largest / math.sqrt(2.0)


def compute_flicker(exposure_time_s: float, *, mains_frequency_hz: float) -> float:
    """Compute the largest relative error of an exposure under fully modulated light.

    Parameters
    ----------
    exposure_time_s : float
        Exposure time [s].
    mains_frequency_hz : float
        Frequency of the mains [Hz].

    Returns
    -------
    float
        Largest relative error, over all phases.

    Notes
    -----
    Light 1 + m sin(2 pi f t + phase), f twice the mains frequency, averaged over the exposure time t::

        largest error = m |sin(pi f t)| / (pi f t)

    It is 0 for t = n / f. A rolling shutter turns it into bands, which a region averages in part.
    """
    turns = 2.0 * mains_frequency_hz * exposure_time_s
    return abs(math.sin(math.pi * turns)) / (math.pi * turns)
