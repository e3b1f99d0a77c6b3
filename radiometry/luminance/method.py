"""Luminance: the coefficient K that converts a region's raw signal into cd/m2, per ISO value.

    N - D = K X,   X = t S L / f^2          apply: L = (N - D) f^2 / (K t S)

N is the region's mean raw value, D its dark signal, L the luminance METER's reading of the scene. The
procedure (standard operating procedure "Drone Camera Calibration", equation 1) also describes an X computed
from N itself; that needs the K that is to be fitted, and is not implemented. The weighting of
`radiometry.fitting.curve` replaces the plain regression of the procedure.
"""

import itertools
import math
from collections.abc import Sequence
from typing import Any

import scipy

from radiometry.findings import Raised, shared
from radiometry.fitting.evidence import CoefficientValue, FrameEvidence, require_complete
from radiometry.fitting.sources import IMPLAUSIBLE_SCATTER_REL
from radiometry.frame import Frame, roi, statistics
from radiometry.frame.verdicts import flag_not_dark, flag_rendered
from radiometry.luminance import codes, suggestions
from radiometry.luminance.brightness import find_doubted
from radiometry.luminance.fit import fit_series
from radiometry.luminance.points import DETECTION_ERRORS, FEW_POINTS, IsoSeries, check_dark, collect_series
from radiometry.luminance.results import Aperture, Coefficient, Fit, IsoFit, ModelFit, SpectralQuality
from radiometry.luminance.rows import FrameRow, Params, Reading
from radiometry.luminance.scenes import (
    check_reading_times,
    check_scenes,
    meter_calibration_u_rel,
    summarise_scenes,
)
from radiometry.luminance.verdicts import inspect_darks
from radiometry.spectral.lamps import LABELS
from radiometry.spectral.mismatch import compute_f1_prime, describe_curve, list_lamps, list_responses

_DISCOUNTED = 0.1
_USUAL_CERTIFICATE_U_REL = 0.015
_MOST_NAMES = 3
_NONLINEARITY = 0.02
_IMPLAUSIBLE_RATIO = 4.0
_CHANCE = 0.01
_AICC_DIFFERENCE = 10.0


def extract(frame: Frame, polygon: roi.Polygon) -> tuple[statistics.ChannelStatistics, ...]:
    """Compute the statistics of a region, one row per channel."""
    return statistics.compute_statistics(frame, roi.require_pixels(roi.mask(polygon, frame.window)))


def make_row(evidence: FrameEvidence[None]) -> FrameRow:
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

    A scene without a reading is named although the other scenes may be enough: `fit` then leaves it out. A
    reading that is off its frames by a factor of two is named too.
    """
    awaited = suggestions.list_unread_scenes(rows, readings, params)
    lacking = suggestions.list_missing(rows, readings, params, unread=unread, awaited=awaited)
    doubted = suggestions.list_doubted(rows, readings, params, gravely=True)
    return (*lacking, *suggestions.name_unread(awaited), *doubted)


def fit(rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params) -> Fit:
    """Fit K for every ISO value of a campaign.

    The same input in any order gives the same result to the last bit. All values are finite; what does not
    exist is None.
    """
    require_complete(suggestions.list_missing(rows, readings, params))
    suggestions.require_shares(rows, params)
    calibration_u_rel, certified = meter_calibration_u_rel(readings)
    scenes = summarise_scenes(readings, panel_rho=params.panel_rho)
    series = collect_series(rows, readings, params)
    fitted = [
        fit_series(one, params, calibration_u_rel=calibration_u_rel, certified=certified) for one in series
    ]
    iso_fits = tuple(iso_fit for iso_fit, _ in fitted)
    points = tuple(itertools.chain.from_iterable(points for _, points in fitted))
    flags = check_scenes(scenes) + check_reading_times(rows, readings)
    kept = [each for each in find_doubted(series, readings) if each.reason]
    flags += [codes.READING_OFF.at(f"scene {each.scene}", f"{each.describe()}.") for each in kept]
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
    ks: list[CoefficientValue] = []
    apertures: list[CoefficientValue] = []
    darks: list[CoefficientValue] = []
    for coefficient in sorted((each.coefficient for each in fitted.iso_fits), key=lambda each: each.iso):
        flags = sorted({*where.get("", []), *where.get(f"iso {coefficient.iso:g}", [])})
        held: dict[str, Any] = {
            "iso": coefficient.iso,
            "channel": coefficient.channel,
            "model": coefficient.model,
            "flags": tuple(flags),
        }
        of_k: tuple[Coefficient | Aperture, ...] = (coefficient, *(coefficient.apertures or ()))
        for each in of_k:
            value = CoefficientValue(
                name="luminance_k",
                value=each.luminance_k,
                standard_uncertainty=each.luminance_k_standard_uncertainty,
                unit=coefficient.luminance_k_unit,
                f_number=each.f_number if isinstance(each, Aperture) else None,
                effective_dof=each.effective_dof,
                coverage_factor=each.coverage_factor,
                **held,
            )
            (apertures if isinstance(each, Aperture) else ks).append(value)
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


def check_series(series: IsoSeries, rows: Sequence[FrameRow], params: Params) -> list[Raised]:
    where = f"iso {series.iso:g}"
    used = {candidate.frame for candidate in series.used}
    light = [row for row in rows if row.frame in used]
    flags = check_dark(series)
    excluded = {exclusion.frame for exclusion in params.exclude}
    mine = [row for row in rows if row.exposure.iso == series.iso and row.frame not in excluded]
    doubted = {frame: reason for frame, (reason,) in inspect_darks(mine, params).items()}
    flags += flag_not_dark({frame: why for frame, why in doubted.items() if why.outcome == "fail"}, where)
    if len(used) < FEW_POINTS:
        flags.append(shared.FEW_POINTS.at(where, f"Points: {len(used)}."))
    flags += flag_rendered([row.rendered for row in light], where)
    tabled = sum(row.from_table for row in mine)
    if tabled:
        detail = f"Rows of a table: {tabled} of {len(mine)} frames."
        flags.append(shared.STATISTICS_FROM_TABLE.at(where, detail))
    assumed = sum(row.assumes_black for row in light)
    if assumed:
        use = "for plausibility alone" if series.dark_times_s else "as the dark signal"
        detail = f"Frames without a black level: {assumed} of {len(light)}; 0 DN is used {use}."
        flags.append(shared.BLACK_LEVEL_ASSUMED.at(where, detail))
    maps = {tuple(sorted(row.gain_maps)) for row in light}
    if len(maps) > 1:
        flags.append(codes.GAIN_MAPS_DIFFER.at(where, f"Different sets of gain maps: {len(maps)}."))
    without = sum(not row.exposure.has_apex for row in light)
    if params.exposure_basis == "apex" and without:
        flags.append(codes.APEX_MISSING.at(where, f"Frames without APEX values: {without}."))
    return flags


def check_iso_fit(series: IsoSeries, iso_fit: IsoFit, params: Params) -> list[Raised]:
    where = f"iso {series.iso:g}"
    by_model = {fit.model: fit for fit in iso_fit.models}
    flags: list[Raised] = []
    if "power" in by_model and abs(by_model["power"].parameters[1] - 1.0) > _NONLINEARITY:
        exponent, error = by_model["power"].parameters[1], by_model["power"].covariance[1][1] ** 0.5
        flags.append(codes.NONLINEAR.at(where, f"Exponent {exponent:.4f}, standard error {error:.4f}."))
    k = by_model.get("proportional", by_model[params.model]).parameters[0]
    if not 1 / _IMPLAUSIBLE_RATIO <= k / iso_fit.expected_k <= _IMPLAUSIBLE_RATIO:
        flags.append(codes.IMPLAUSIBLE_K.at(where, f"K {k:.4g}, expected {iso_fit.expected_k:.4g}."))
    flags += _check_scatter(by_model[params.model], where)
    flags += _check_offset(by_model, series, iso_fit.coefficient, where)
    flags += _check_repeatability(by_model[params.model], params, where)
    if not iso_fit.passed:
        width = f", U {iso_fit.expanded_u_rel:.1%}" if iso_fit.expanded_u_rel is not None else ""
        if not width and params.acceptance not in {None, "simple"}:
            width = ", U unknown without a meter certificate, which the decision rule needs"
        detail = (
            f"Largest error in L {iso_fit.largest_residual_rel:.1%}{width}, tolerance "
            f"{params.tolerance_rel:.1%}."
        )
        flags.append(codes.TOLERANCE_EXCEEDED.at(where, detail))
    return flags


def _check_repeatability(chosen: ModelFit, params: Params, where: str) -> list[Raised]:
    """Name a scatter that no meter or shutter has; else, that the meter's repeatability was estimated."""
    given = params.meter_repeatability_rel is not None or chosen.meter_repeatability_rel is None
    reading = 0.0 if given else chosen.meter_repeatability_rel or 0.0
    frame = chosen.frame_scatter_rel or 0.0
    if max(reading, frame) > IMPLAUSIBLE_SCATTER_REL:
        detail = f"Estimated: {reading:.1%} for one meter reading, {frame:.1%} between frames."
        return [shared.SCATTER_IMPLAUSIBLE.at(where, detail)]
    return [] if given else [codes.METER_REPEATABILITY_ESTIMATED.at(where, f"Estimated: {reading:.2%}.")]


def _check_offset(
    by_model: dict[str, ModelFit], series: IsoSeries, coefficient: Coefficient, where: str
) -> list[Raised]:
    """Compare the affine model with the proportional one; at 10 in AICc the latter has hardly any support."""
    weakest_dn = coefficient.signal_range_dn[0]
    rate, u_rate = coefficient.dark_rate_dn_per_s or 0.0, coefficient.dark_rate_standard_uncertainty_dn_per_s
    if not series.dark.rate_measured and u_rate and abs(rate) > DETECTION_ERRORS * u_rate:
        longest_s = max(coefficient.exposure_times_s, key=lambda time_s: abs(time_s - series.dark.time_s))
        offset = rate * (longest_s - series.dark.time_s)
        detail = (
            f"Offset that differs by {offset:+.3g} DN between {longest_s:g} s and {series.dark.time_s:g} s, "
            "taken as dark current: take dark frames at both times."
        )
        return [codes.OFFSET_SIGNIFICANT.at(where, detail)]
    with_offset, without = by_model.get("affine"), by_model["proportional"]
    if with_offset is None or with_offset.aicc is None or without.aicc is None:
        return []
    better = without.aicc - with_offset.aicc
    if better <= _AICC_DIFFERENCE:
        return []
    offset, u_offset = with_offset.parameters[1], with_offset.covariance[1][1] ** 0.5
    detail = (
        f"Offset {offset:+.3g} DN, standard uncertainty {u_offset:.2g} DN: {abs(offset) / weakest_dn:.0%} of "
        f"the weakest point; AICc is better by {better:.0f}."
    )
    return [codes.OFFSET_SIGNIFICANT.at(where, detail)]


def _check_scatter(chosen: ModelFit, where: str) -> list[Raised]:
    """Test at 99 % by chi^2 whether the points scatter more than the stated sources explain."""
    stated = chosen.chi_squared if chosen.stated_chi_squared is None else chosen.stated_chi_squared
    if stated is None or stated <= scipy.special.chdtri(chosen.dof, _CHANCE):
        return []
    between = (
        f"; between frames {chosen.frame_scatter_rel:.2%}" if chosen.frame_scatter_rel is not None else ""
    )
    detail = (
        f"chi^2 / dof by the stated sources {stated / chosen.dof:.3g}{between}; "
        f"Birge ratio {chosen.birge_ratio:.3f}."
    )
    return [shared.SCATTER_EXCEEDS_UNCERTAINTY.at(where, detail)]
