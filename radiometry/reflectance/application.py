"""Application of a reflectance calibration to a new frame: a region, or every pixel of a window."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import Raised, shared
from radiometry.fitting.evidence import Quantity
from radiometry.frame import Frame, FrameHeader
from radiometry.frame.exposure import Exposure
from radiometry.reflectance import codes
from radiometry.reflectance.features import Features
from radiometry.reflectance.imaging import compute_signal
from radiometry.reflectance.points import MOST_SATURATED_SHARE
from radiometry.reflectance.results import REFLECTANCE_UNIT, AppliedReflectance, Coefficient, Effect
from radiometry.reflectance.scale import find_scale_of_frame


def apply_features(
    features: Features,
    *,
    header: FrameHeader,
    coefficients: Sequence[Coefficient],
    incidence_angle_deg: float | None = None,
) -> AppliedReflectance:
    """Compute the reflectance of a region with its uncertainty; nothing is clipped to [0, 1].

    Parameters
    ----------
    features : Features
        Features of the region.
    header : FrameHeader
        Metadata of the frame.
    coefficients : sequence of Coefficient
        Coefficients of the version, one per band.
    incidence_angle_deg : float or None, default: None
        Angle between the light and the surface's normal [deg]; None for that of the
        fit.

    Returns
    -------
    AppliedReflectance
        Reflectance. Flags: those of `find_scale_of_frame`, and `saturated`,
        `below_detection`, `reflectance_out_of_range`.

    Raises
    ------
    InputRejected
        As `find_scale_of_frame`.
    """
    scale = find_scale_of_frame(header, coefficients=coefficients, incidence_angle_deg=incidence_angle_deg)
    value = features.i_sq * scale.factor
    noise = features.i_sq_standard_uncertainty * abs(scale.factor)
    effects = (
        *(Effect(source=source, shared=True, effect=value * u_rel) for source, u_rel in scale.sources),
        Effect(source="pixel noise", shared=False, effect=noise),
    )
    return AppliedReflectance(
        band=features.band,
        reflectance=Quantity(
            value=value,
            standard_uncertainty=math.hypot(*(effect.effect for effect in effects)),
            unit=REFLECTANCE_UNIT,
        ),
        i_sq=features.i_sq,
        i_ss=scale.i_ss,
        reflectance_k=scale.reflectance_k,
        effects=effects,
        i_ss_oriented=scale.i_ss_oriented,
        i_ss_basis=scale.i_ss_basis,
        flags=(*scale.flags, *_check_features(features, value, noise)),
    )


def scale_pixels(
    frame: Frame, *, header: FrameHeader, exposure: Exposure, factor: float = 1.0
) -> NDArray[np.float32]:
    """Compute a multiple of the signal of every pixel of a window; it equals that of the whole frame there.

    With the factor of a `Scale` it is the reflectance, with 1 the radiance of a MicaSense camera. Nothing is
    clipped.

    Parameters
    ----------
    frame : Frame
        Window of the frame.
    header : FrameHeader
        Metadata of the frame.
    exposure : Exposure
        Exposure of the frame.
    factor : float, default: 1.0
        Factor of the signal.

    Returns
    -------
    ndarray of float32
        Signal, (row, col); NaN where saturated.

    Raises
    ------
    InputRejected
        `sensor_model_unusable`.
    """
    signal = compute_signal(frame, header=header, settings=exposure.on_basis("nominal"))
    found: NDArray[np.float32] = (signal * factor).astype(np.float32)
    found[frame.samples_dn >= min(frame.white_level_dn)] = np.nan
    return found


def _check_features(features: Features, value: float, noise: float) -> list[Raised]:
    raised = []
    share = features.statistics.saturated_share
    if share > MOST_SATURATED_SHARE:
        raised.append(shared.SATURATED.at("", f"{share:.2%} of the samples."))
    if value < 3.0 * noise:
        detail = f"Reflectance {value:.3g}, pixel noise {noise:.3g}."
        raised.append(shared.BELOW_DETECTION.at("", detail))
    if not 0.0 <= value <= 1.0:
        raised.append(codes.REFLECTANCE_OUT_OF_RANGE.at("", f"{value:.4g}."))
    return raised
