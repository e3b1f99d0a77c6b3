"""Luminance: the coefficient K that converts a region's raw signal into cd/m2, per ISO value.

    N - D = K X,   X = t S L / f^2          apply: L = (N - D) f^2 / (K t S)

N is the region's mean raw value, D its dark signal, L the luminance METER's reading
of the scene. The procedure (standard operating procedure "Drone Camera
Calibration", equation 1) also describes an X computed from N itself; that needs the
K that is to be fitted, and is not implemented. The weighting of
`radiometry.fitting.curve` replaces the plain regression of the procedure.
"""

import itertools
import math
from collections.abc import Sequence
from typing import Any

from radiometry.findings import InputRejected, shared
from radiometry.fitting.evidence import CoefficientValue, FrameEvidence
from radiometry.frame import Frame
from radiometry.frame.roi import Polygon, Window, mask
from radiometry.frame.statistics import ChannelStatistics, compute_statistics
from radiometry.luminance import codes
from radiometry.luminance.checks import check_iso_fit, check_series
from radiometry.luminance.curves import fit_series
from radiometry.luminance.lamp import check_reading_times
from radiometry.luminance.lamp_kinds import LABELS
from radiometry.luminance.missing import list_missing, list_unread_scenes, require_shares
from radiometry.luminance.points import collect_series
from radiometry.luminance.results import Fit, IsoFit, SpectralQuality
from radiometry.luminance.rows import FrameRow, Params, Reading
from radiometry.luminance.scenes import check_scenes, meter_calibration_u_rel, summarise_scenes
from radiometry.spectral.curves import describe_curve, list_lamps, list_responses
from radiometry.spectral.mismatch import compute_f1_prime

_DISCOUNTED = 0.1
_USUAL_CERTIFICATE_U_REL = 0.015
_MOST_NAMES = 3


def extract(frame: Frame, polygon: Polygon) -> tuple[ChannelStatistics, ...]:
    """Compute the statistics of a region, one row per channel.

    Raises
    ------
    InputRejected
        `roi_empty` if no pixel of the frame belongs to the region.
    """
    height, width = frame.samples_dn.shape[:2]
    inside = mask(polygon, Window(row0=frame.row0, col0=frame.col0, height=height, width=width))
    if not inside.any():
        raise InputRejected(shared.ROI_EMPTY, "The region holds no pixel of this window of the frame.")
    return compute_statistics(frame, inside)


def make_row(evidence: FrameEvidence[None]) -> FrameRow:
    """Convert the evidence of a frame to the row that the fit uses.

    Raises
    ------
    ValueError
        If the frame has no exposure.
    """
    if evidence.exposure is None:
        raise ValueError(f"a light or dark frame without its exposure: {evidence.frame}")
    maps = (opcode.sha256 for opcode in evidence.header.opcodes if opcode.name == "GainMap")
    return FrameRow(
        frame=evidence.frame,
        role=evidence.role,
        scene=evidence.scene,
        exposure=evidence.exposure,
        statistics=evidence.statistics,
        has_region=evidence.has_region,
        rendered=evidence.header.rendered,
        from_table=evidence.header.table is not None,
        assumes_black=evidence.header.assumes_black,
        taken_at=evidence.header.zoned_at,
        gain_maps=tuple(maps),
    )


def missing(
    rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params, *, unread: Sequence[str] = ()
) -> tuple[str, ...]:
    """List by name what the fit still lacks.

    Returns
    -------
    tuple of str
        Fragments of sentences; empty if the fit can start with every frame.

    Notes
    -----
    A scene without a reading is named although the other scenes may be enough:
    `fit` then leaves it out.
    """
    lacking = list_missing(rows, readings, params, unread=unread)
    return (*lacking, *list_unread_scenes(rows, readings, params))


def fit(rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params) -> Fit:
    """Fit K for every ISO value of a campaign.

    Returns
    -------
    Fit
        Coefficients, points and flags. Per ISO value: `dark_exposure_differs`,
        `dark_from_black_level`, `dark_from_few_frames`, `dark_varies`,
        `dark_not_dark`, `nonlinear`, `implausible_k`, `few_points`,
        `tolerance_exceeded`, `scatter_exceeds_uncertainty`, `scatter_implausible`,
        `offset_significant`, `outliers_discounted`, `gain_maps_differ`, `rendered`,
        `meter_repeatability_estimated`, `apex_missing`. Per scene:
        `lamp_drift`, `rho_cross_check`, `reading_far_from_frames`. Of the whole:
        `meter_certificate_missing`, `semilog_model`.

    Raises
    ------
    InputRejected
        `fit_incomplete` if fewer than three scenes of an ISO value can be used, or
        frames are not extracted yet. `fit_failed` if the fit does not converge.
        `vignetting_not_calibrated` if V of a light frame is not given.

    Notes
    -----
    The same input in any order gives the same result to the last bit. All values
    are finite; what does not exist is None.
    """
    lacking = list_missing(rows, readings, params)
    if lacking:
        raise InputRejected(shared.FIT_INCOMPLETE, f"The fit cannot start: {'; '.join(lacking)}.")
    require_shares(rows, params)
    calibration_u_rel, certified = meter_calibration_u_rel(readings)
    scenes = summarise_scenes(readings, panel_rho=params.panel_rho)
    series = collect_series(rows, readings, params)
    fitted = [
        fit_series(one, params, calibration_u_rel=calibration_u_rel, certified=certified) for one in series
    ]
    iso_fits = tuple(iso_fit for iso_fit, _ in fitted)
    points = tuple(itertools.chain.from_iterable(points for _, points in fitted))
    flags = check_scenes(scenes) + check_reading_times(rows, readings)
    for one, iso_fit in zip(series, iso_fits, strict=True):
        flags += check_series(one, rows, params) + check_iso_fit(one, iso_fit, params)
    for one in series:
        outliers = [p.frame for p in points if p.iso == one.iso and (p.robust_weight or 1.0) < _DISCOUNTED]
        if outliers:
            named = f"{', '.join(outliers[:_MOST_NAMES])}{' and more' if len(outliers) > _MOST_NAMES else ''}"
            flags.append(codes.OUTLIERS_DISCOUNTED.at(f"iso {one.iso:g}", f"{len(outliers)}: {named}."))
    if not certified:
        flags.append(codes.METER_CERTIFICATE_MISSING.at("", _weigh_certificate(iso_fits)))
    if params.model == "semilog":
        flags.append(codes.SEMILOG_MODEL.at("", "Chosen by the parameters of this fit."))
    return Fit(
        iso_fits=iso_fits,
        points=points,
        scenes=scenes,
        flags=tuple(flags),
        tolerance_rel=params.tolerance_rel,
        passed=all(iso_fit.passed for iso_fit in iso_fits),
        spectral=_judge_spectrum(params),
    )


def _judge_spectrum(params: Params) -> SpectralQuality | None:
    lamp, response, kind = params.lamp, params.camera_response, params.lamp_kind
    if lamp is None and response is None and kind is None:
        return None
    return SpectralQuality(
        lamp=LABELS[kind] if kind and lamp is None else describe_curve(lamp, list_lamps()),
        camera_response=describe_curve(response, list_responses()),
        f1_prime=compute_f1_prime(response, channel=params.channel) if response is not None else None,
    )


def list_coefficients(fitted: Fit) -> tuple[CoefficientValue, ...]:
    """List K of every ISO value, K of each of its f-numbers, then the dark signals, by rising ISO value."""
    where: dict[str, list[str]] = {raised.where: [] for raised in fitted.flags}
    for raised in fitted.flags:
        where[raised.where].append(raised.flag)
    ks, apertures, darks = [], [], []
    for coefficient in sorted((each.coefficient for each in fitted.iso_fits), key=lambda each: each.iso):
        flags = sorted({*where.get("", []), *where.get(f"iso {coefficient.iso:g}", [])})
        held: dict[str, Any] = {
            "iso": coefficient.iso,
            "channel": coefficient.channel,
            "model": coefficient.model,
            "flags": tuple(flags),
        }
        ks.append(
            CoefficientValue(
                name="luminance_k",
                value=coefficient.luminance_k,
                standard_uncertainty=coefficient.luminance_k_standard_uncertainty,
                unit=coefficient.luminance_k_unit,
                effective_dof=coefficient.effective_dof,
                coverage_factor=coefficient.coverage_factor,
                **held,
            )
        )
        apertures += [
            CoefficientValue(
                name="luminance_k",
                value=aperture.luminance_k,
                standard_uncertainty=aperture.luminance_k_standard_uncertainty,
                unit=coefficient.luminance_k_unit,
                f_number=aperture.f_number,
                effective_dof=aperture.effective_dof,
                coverage_factor=aperture.coverage_factor,
                **held,
            )
            for aperture in coefficient.apertures or ()
        ]
        darks.append(
            CoefficientValue(
                name="dark_signal_dn",
                value=coefficient.dark_signal_dn,
                standard_uncertainty=coefficient.dark_signal_standard_uncertainty_dn,
                unit="DN",
                **held,
            )
        )
    return (*ks, *apertures, *darks)


def _weigh_certificate(iso_fits: Sequence[IsoFit]) -> str:
    """State the expanded uncertainty of K without a meter certificate, and with a usual one."""
    widest = max(
        (each.coefficient for each in iso_fits), key=lambda c: c.expanded_uncertainty / abs(c.luminance_k)
    )
    u_rel = widest.luminance_k_standard_uncertainty / abs(widest.luminance_k)
    factor = widest.coverage_factor
    with_it = factor * math.hypot(u_rel, _USUAL_CERTIFICATE_U_REL)
    return (
        f"Without the meter's scale, U(K) is {factor * u_rel:.1%} at ISO {widest.iso:g}. With a meter "
        f"certificate of U = {2 * _USUAL_CERTIFICATE_U_REL:.0%} (k = 2) it would be {with_it:.1%}, traceable."
    )
