"""Flags of a reflectance fit, verdict on every frame of its campaign, and advice."""

import math
from collections.abc import Sequence
from dataclasses import replace

from radiometry.findings import InputRejected, Raised, Reason, interface, shared
from radiometry.frame import FrameHeader, has_set_clock, multispectral
from radiometry.frame.exposure import Exposure
from radiometry.frame.verdicts import ReviewedFrame, Verdict, conclude, inspect_frames
from radiometry.reflectance import codes, imaging, points, sun, sunshine
from radiometry.reflectance.results import HALF_HOUR_S, BandFit, FrameRow, Params, Reading, interpolate

STEEPEST_GRADIENT_REL = 0.03
LARGEST_DRIFT_REL = 0.03
# Between the largest A of the older scale, 4e5, and the smallest of the newer, some 1e8.
_NEWER_SCALE = 1e7
_BLACK_TOLERANCE_REL = 0.01
_PLAUSIBLE = 1.5
_ROUTES_AGREE_REL = 0.1


def review_frame(header: FrameHeader, *, exposure: Exposure | None) -> list[Raised]:
    """Check a file when it is read, so that nothing is drawn on one that cannot be used."""
    band = header.multispectral
    if band is not None and band.kind is not None:
        return [shared.FRAME_LEFT_OUT.at("", imaging.describe_kind(band))]
    if exposure is not None:
        imaging.inspect_band(header, exposure.on_basis("nominal"))
    return [*check_frame(header), *(_find_second_channel(band) if band is not None else ())]


def _find_second_channel(band: multispectral.Multispectral) -> list[Raised]:
    """Return the flag of a file whose every reading of channel 0 was left out."""
    try:
        found = sunshine.measure_sunshine(band).flags
    except InputRejected:
        return []
    return [raised for raised in found if raised.flag == codes.SUNSHINE_SECOND_CHANNEL]


def check_frame(header: FrameHeader, *, where: str = "") -> list[Raised]:
    if header.assumes_black:
        return [shared.BLACK_LEVEL_ASSUMED.at(where, "0 DN was subtracted from the signal.")]
    band = header.multispectral
    if band is None:
        return []
    raised, at = [], sun.read_clock(header)
    if at is not None and not has_set_clock(at):
        raised.append(codes.CLOCK_NOT_SET.at(where, f"{at:%Y-%m-%d}."))
    if band.sensor_model is not None and band.sensor_model.a > _NEWER_SCALE:
        raised.append(codes.SENSOR_MODEL_SCALE.at(where, f"A = {band.sensor_model.a:g}."))
    black_dn = sum(header.black_level_dn) / len(header.black_level_dn)
    used_dn = imaging.find_black_dn(band, header.black_level_dn)
    if header.black_level_origin == "tag" and abs(used_dn - black_dn) > _BLACK_TOLERANCE_REL * min(
        header.white_level_dn
    ):
        detail = f"The band's own {used_dn:g} DN, black level tag {black_dn:g} DN; the former was used."
        raised.append(codes.BLACK_LEVEL_DISAGREES.at(where, detail))
    return raised


def check_candidates(candidates: Sequence[points.Candidate]) -> list[Raised]:
    raised: list[Raised] = []
    for each in candidates:
        where = f"frame {each.row.frame}"
        features = each.row.features
        if features is not None and features.statistics.saturated_share > points.MOST_SATURATED_SHARE:
            detail = f"{features.statistics.saturated_share:.1%} of the region. Shorten the exposure."
            raised.append(codes.PANEL_SATURATED.at(where, detail))
        if each.left_out_code == codes.SUNSHINE_STALE:
            raised.append(codes.SUNSHINE_STALE.at(where, each.left_out))
        if not each.left_out:
            raised += check_frame(each.row.header, where=where)
            if not each.row.header.serial:
                raised.append(shared.SERIAL_UNKNOWN.at(where, "No serial number."))
            if each.sunshine and not each.band.sunshine_serial:
                raised.append(codes.SUNSHINE_SERIAL_UNKNOWN.at(where, "No serial number."))
    used = [each for each in candidates if not each.left_out]
    if used and not any(points.list_named(each.row) for each in used):
        raised.append(codes.PANEL_NOT_IDENTIFIED.at("", f"Frames: {len(used)}."))
    return [*raised, *points.sunshine_flags(candidates), *_find_missing_bands(candidates)]


def _find_missing_bands(candidates: Sequence[points.Candidate]) -> list[Raised]:
    """Compare the bands of each panel capture with those of all together."""
    captures: dict[str, set[str]] = {}
    for each in candidates:
        if each.band.capture_id:
            captures.setdefault(each.band.capture_id, set()).add(each.band.band)
    usual = set().union(*captures.values()) if captures else set()
    return [
        codes.BAND_MISSING.at(f"capture {capture}", f"Not there: {', '.join(sorted(usual - bands))}.")
        for capture, bands in sorted(captures.items())
        if usual - bands
    ]


def check_fit(fit: BandFit, used: Sequence[points.Candidate]) -> list[Raised]:
    where = f"band {fit.coefficient.band}"
    steepest = max(each.features.gradient_rel for each in used)
    raised = []
    if steepest > STEEPEST_GRADIENT_REL:
        detail = f"{steepest:.1%} across the region: a shadow, a reflection, or the panel's rim."
        raised.append(codes.PANEL_UNEVEN.at(where, detail))
    panels = [each.panel for each in used if each.panel is not None]
    if any(panel.from_file for panel in panels):
        raised.append(codes.PANEL_FROM_FILE.at(where, f"Reflectance {fit.coefficient.panel_reflectance:g}."))
    oldest = max(panels, key=lambda panel: panel.age_days)
    if oldest.age_days > points.OLD_DAYS:
        detail = f"Measured on {oldest.measured_on[0]}, {oldest.age_days / 365.25:.1f} years from the frames."
        raised.append(codes.PANEL_OLD.at(where, detail))
    if not any(panel.states_uncertainty for panel in panels):
        raised.append(codes.PANEL_UNCERTAINTY_MISSING.at(where, "State it with the panel."))
    k = fit.coefficient.reflectance_k
    if fit.coefficient.reflectance_k_unit == "sr" and not 1.0 / _PLAUSIBLE < k / math.pi < _PLAUSIBLE:
        raised.append(codes.IMPLAUSIBLE_REFLECTANCE_K.at(where, f"K is {k:.3g} sr, pi is expected."))
    if fit.coefficient.reflectance_k_unit == "sr" and abs(k / math.pi - 1.0) > _ROUTES_AGREE_REL:
        detail = f"The light sensor reads {k / math.pi - 1.0:+.1%} against the panel; K is {k:.3g} sr."
        raised.append(codes.LIGHT_ROUTES_DIFFER.at(where, detail))
    if fit.drift_rel is None:
        raised.append(codes.PANEL_ONCE.at(where, _foresee(fit)))
    elif abs(fit.drift_rel) > LARGEST_DRIFT_REL:
        detail = f"{fit.drift_rel:+.1%} from the first to the last of {fit.visits} visits."
        raised.append(codes.PANEL_DRIFT.at(where, detail))
    return raised


def _foresee(fit: BandFit) -> str:
    """State what drift costs half an hour after the only visit, and what it would after a second one."""
    knot, coefficient = fit.coefficient.knots[0], fit.coefficient
    rel = coefficient.drift_half_hour_rel or 0.0
    knots = [replace(knot, at_s=at_s) for at_s in (0.0, HALF_HOUR_S)]
    alone, between = (
        interpolate(each, at_s=at_s, follow=True, drift_rel=rel).drift_u_rel
        for each, at_s in ((knots[:1], HALF_HOUR_S), (knots, HALF_HOUR_S / 2.0))
    )
    return (
        f"Visits to the panel: 1. Half an hour from it {alone:.1%} of K are assumed for drift; with a second "
        f"visit then it would be {between:.1%} in between, if K had not changed."
    )


def judge(
    frames: Sequence[ReviewedFrame], rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params
) -> dict[str, Verdict]:
    reasons = inspect_frames(frames)
    for each in points.collect_candidates(
        rows, readings, replace(params, normalisation="panel_only", exclude=())
    ):
        if each.row.features is not None:
            reasons[each.row.frame] += _inspect_panel(each)
        if difference := points.describe_difference(each.row, readings):
            detail = f"{difference} {interface.PANEL_DIFFERS.remedy}"
            reasons[each.row.frame].append(interface.PANEL_DIFFERS.reason(detail))
    if params.normalisation == "sunshine":
        for row in rows:
            reasons[row.frame] += _inspect_sunshine(row, params)
    return {frame: conclude(found) for frame, found in reasons.items()}


def _inspect_panel(candidate: points.Candidate) -> list[Reason]:
    features, found = candidate.features, []
    saturated = features.statistics.saturated_share
    if saturated > points.MOST_SATURATED_SHARE:
        detail = (
            f"{saturated:.1%} of the panel is saturated: the fit leaves the frame out. "
            "Shorten the exposure and take the panel again."
        )
        found.append(shared.CLIPPED.reason(detail))
    elif candidate.left_out and candidate.left_out != points.NO_REFLECTANCE:
        detail = f"The panel gives no usable signal ({candidate.left_out}): take it again in better light."
        found.append(codes.PANEL_WEAK.reason(detail))
    if features.gradient_rel > STEEPEST_GRADIENT_REL:
        detail = (
            f"The signal changes by {features.gradient_rel:.1%} across the region: a shadow, a reflection or "
            "the panel's rim. Draw the region within the panel, or take the panel again in even light."
        )
        found.append(codes.PANEL_UNEVEN.reason(detail))
    if candidate.left_out == points.NO_REFLECTANCE:
        detail = (
            f"The panel's reflectance in band {candidate.band.band} is not known: "
            "register the panel with this band and name it in the campaign."
        )
        found.append(codes.PANEL_UNKNOWN.reason(detail))
    return found


def _inspect_sunshine(row: FrameRow, params: Params) -> list[Reason]:
    band = row.header.multispectral
    if band is None:
        return []
    try:
        found = sunshine.measure_sunshine(band, choice=params.sunshine_choice)
    except InputRejected as rejected:
        return [codes.SUNSHINE_UNUSABLE.reason(rejected.message)]
    second = codes.SUNSHINE_SECOND_CHANNEL
    return [
        second.reason(f"{second.sentence} {raised.detail} {second.remedy}")
        for raised in found.flags
        if raised.flag == second
    ]


def plan(rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params) -> tuple[str, ...]:
    collected = points.collect_candidates(rows, readings, params)
    candidates = [each for each in collected if not each.left_out]
    advice: list[str] = []
    shown = {row.header.multispectral.band for row in rows if row.header.multispectral is not None}
    if any(row.role == points.PANEL for row in rows):
        # a region or a reflectance that is lacking is asked for by itself
        waiting = {each.frame for each in rows if each.features is None}
        seen = {
            each.band.band
            for each in collected
            if each.left_out in {"", points.NO_REFLECTANCE} or each.row.frame in waiting
        }
        if unseen := ", ".join(sorted(shown - seen)):
            advice.append(f"no panel frame can be used (band {unseen})")
    if candidates and len({each.visit for each in candidates}) == 1:
        advice.append("the panel was photographed once: take it after the flight too, to see the drift")
    if any(each.panel is not None and not each.panel.states_uncertainty for each in candidates):
        advice.append("the panel states no uncertainty: register it with that of its certificate")
    return tuple(advice)
