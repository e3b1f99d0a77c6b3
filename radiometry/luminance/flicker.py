"""Flicker of a lamp on the mains: the error of an exposure that is no whole number of periods."""

import math

import numpy as np

from radiometry.findings import Raised
from radiometry.fitting.evidence import FieldCorrection, Values
from radiometry.fitting.sources import FLICKER
from radiometry.frame.exposure import Settings
from radiometry.luminance import codes
from radiometry.luminance.conditions import FieldConditions
from radiometry.luminance.lamp_kinds import LABELS, find_modulation

MAINS_HZ = (50.0, 60.0)
_NAMED_FLICKER = 0.005
_LARGEST = 0.99
_MIDDLES = (np.arange(200) + 0.5) / 200


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
    A frame shows L (1 + e), e as in `estimate_flicker`, and L is found from what it shows: it errs by
    1 / (1 + e) - 1, which is skewed where e is large. u is its rms over all phases and depths, or 1 / 1.96 of
    what 95 % of them stay below, whichever is larger, so that the expanded interval holds 95 % [1]_. It
    averages over frames. Where neither depth nor kind is stated, the rms of e is taken, which is smaller, and
    too small for times much shorter than a period.

    References
    ----------
    .. [1] JCGM 101:2008, 5.3 and 7.7, doi:10.59161/JCGM101-2008
    """
    mains, stated, kind = field.mains_frequency_hz, field.flicker_modulation, field.lamp_kind
    time_s, (low, high) = settings.exposure_time_s, find_modulation(kind, stated)
    largest, one = estimate_flicker(time_s, mains, modulation=(low, high))
    if stated is not None or kind is not None:
        one = _estimate_inverse(largest, low, high)
    values: Values = {
        "mains_frequency_hz": list(MAINS_HZ) if mains is None else mains,
        "modulation": [low, high],
        "exposure_share": largest,
    }
    supply = "assumed: mains frequency of 50 or 60 Hz" if mains is None else f"{mains:g} Hz mains"
    depth = f"modulation {low:g}" if stated is not None else f"modulation assumed from {low:g} to {high:g}"
    if kind is not None and stated is None:
        values["lamp_kind"] = kind
        depth = f"{LABELS[kind]}: {depth}"
    basis = (
        f"{supply}, {depth}, of which {time_s:g} s show {largest:.1%}" if mains != 0.0 else "direct current"
    )
    line = FieldCorrection(
        source=FLICKER,
        u_rel=one / math.sqrt(frames),
        basis=basis,
        assumed=True if mains is None or (stated is None and kind is None) else None,
        values=values,
    )
    if mains is not None or line.u_rel <= _NAMED_FLICKER:
        return line, ()
    detail = f"At {time_s:g} s, light of 50 or 60 Hz mains can err by {high * largest:.1%}."
    return line, (codes.FLICKER_UNKNOWN.at("", detail),)


def estimate_flicker(
    exposure_time_s: float, mains_frequency_hz: float | None, *, modulation: tuple[float, float]
) -> tuple[float, float]:
    """Return the largest relative error of an exposure under fully modulated light, and its rms.

    Parameters
    ----------
    exposure_time_s : float
        Exposure time [s].
    mains_frequency_hz : float or None
        Frequency of the mains [Hz], 0 of direct current; None for 50 or 60 Hz, whichever errs more.
    modulation : tuple[float, float]
        Smallest and largest modulation depth.

    Returns
    -------
    tuple of float
        Largest error at full modulation, and the rms over all phases and over the modulations.

    Notes
    -----
    With the largest error h of `compute_flicker` at full modulation, a phase that is anywhere and a depth
    that is anywhere from a to b, both with equal probability [1]_::

        u^2 = h^2 / 2 (a^2 + a b + b^2) / 3

    References
    ----------
    .. [1] JCGM 100:2008, 4.3.7 and 4.4.5, doi:10.59161/JCGM100-2008E
    """
    frequencies = MAINS_HZ if mains_frequency_hz is None else (mains_frequency_hz,)
    largest = max(compute_flicker(exposure_time_s, mains_frequency_hz=each) for each in frequencies)
    low, high = modulation
    return largest, largest * math.sqrt((low * low + low * high + high * high) / 6.0)


def _estimate_inverse(largest: float, low: float, high: float) -> float:
    """Return u of 1 / (1 + e) over all phases and the depths from `low` to `high`."""
    # light that goes out altogether is not known at all from a moment of it
    share = min(largest, _LARGEST / high) if high else 0.0
    depths = low + (high - low) * _MIDDLES[:, None]
    errors = np.abs(1.0 / (1.0 + share * depths * np.sin(2.0 * np.pi * _MIDDLES)) - 1.0)
    return max(float(np.sqrt(np.mean(errors**2))), float(np.quantile(errors, 0.95)) / 1.96)


def compute_flicker(exposure_time_s: float, *, mains_frequency_hz: float) -> float:
    """Compute the largest relative error of an exposure under fully modulated light.

    Parameters
    ----------
    exposure_time_s : float
        Exposure time [s].
    mains_frequency_hz : float
        Frequency of the mains [Hz]; 0 of direct current, which does not flicker.

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
    if not turns:
        return 0.0
    return abs(math.sin(math.pi * turns)) / (math.pi * turns)
