"""Checks of the frames that entered a luminance fit, and of its result."""

from collections.abc import Sequence

import scipy

from radiometry.findings import Raised, shared
from radiometry.fitting.sources import IMPLAUSIBLE_SCATTER_REL
from radiometry.frame.darkness import flag_not_dark
from radiometry.luminance import codes
from radiometry.luminance.coefficient import Coefficient
from radiometry.luminance.dark import check_dark
from radiometry.luminance.darkness import inspect_darks
from radiometry.luminance.points import DETECTION_ERRORS, FEW_POINTS, IsoSeries
from radiometry.luminance.results import IsoFit, ModelFit
from radiometry.luminance.rows import FrameRow, Params

_NONLINEARITY = 0.02
_IMPLAUSIBLE_RATIO = 4.0
_CHANCE = 0.01
_AICC_DIFFERENCE = 10.0


def check_series(series: IsoSeries, rows: Sequence[FrameRow], params: Params) -> list[Raised]:
    """Check the frames that entered the fit."""
    where = f"iso {series.iso:g}"
    used = {candidate.frame for candidate in series.used}
    light = [row for row in rows if row.frame in used]
    flags = check_dark(
        series.dark,
        iso=series.iso,
        light_times_s=[candidate.settings.exposure_time_s for candidate in series.used],
        dark_times_s=series.dark_times_s,
        weakest_signal_dn=min(c.above_dark_dn for c in series.used),
    )
    excluded = {exclusion.frame for exclusion in params.exclude}
    mine = [row for row in rows if row.exposure.iso == series.iso and row.frame not in excluded]
    doubted = {frame: reason for frame, (reason,) in inspect_darks(mine, params).items()}
    flags += flag_not_dark({frame: why for frame, why in doubted.items() if why.outcome == "fail"}, where)
    if len(used) < FEW_POINTS:
        flags.append(shared.FEW_POINTS.at(where, f"Points: {len(used)}."))
    rendered = sum(row.rendered for row in light)
    if rendered:
        flags.append(shared.RENDERED.at(where, f"Rendered frames: {rendered} of {len(light)}."))
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
    """Check the result of the fit."""
    where = f"iso {series.iso:g}"
    by_model = {fit.model: fit for fit in iso_fit.models}
    flags: list[Raised] = []
    if "power" in by_model and abs(by_model["power"].parameters[1] - 1.0) > _NONLINEARITY:
        exponent, error = by_model["power"].parameters[1], by_model["power"].covariance[1][1] ** 0.5
        flags.append(codes.NONLINEAR.at(where, f"Exponent {exponent:.4f}, standard error {error:.4f}."))
    k = by_model["proportional"].parameters[0]  # one parameter, points above dark: it always converges
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
