"""The fit of a campaign: every f-number and channel, with flags, thresholds and coefficients."""

import itertools
import math
from collections import Counter
from collections.abc import Sequence

import numpy as np

from radiometry.findings import Raised, shared
from radiometry.fitting import evidence
from radiometry.frame.statistics import CHANNELS
from radiometry.frame.verdicts import flag_assumed_black, flag_not_dark, flag_rendered
from radiometry.vignetting import codes, falloff, points, results
from radiometry.vignetting.blocks import FrameRow
from radiometry.vignetting.channels import FittedChannel, farthest_radius, find_best, fit_channel
from radiometry.vignetting.light import EXPOSURE_RATIO, find_not_dark
from radiometry.vignetting.points import Candidate
from radiometry.vignetting.results import Coefficient, Conventions, Fit, Params, Threshold, write_equation

LIMITS = (0.02, 0.10)  # The falloffs about which the report asks

_ERRORS = 3.0
_SURE_ERRORS = 2.0
_RISE = 0.005
_MISFIT_REL = 0.005
_FAR_CENTRE = 0.1  # Of the half diagonal: lenses and sensors are mounted ten times better than that

Fitted = Sequence[FittedChannel]


def find_thresholds(fitted: Fitted) -> tuple[Threshold, ...]:
    """Find from which f-number on the falloff is below 2 % and below 10 %, in every channel."""
    worst: dict[float, tuple[float, float]] = {}
    for each in fitted:
        of = each.fit.coefficient
        found = (each.fit.largest_falloff, of.corner_falloff_standard_uncertainty)
        worst[of.f_number] = max(worst.get(of.f_number, (-math.inf, 0.0)), found)
    return tuple(_find_threshold(worst, limit) for limit in LIMITS)


def _find_threshold(worst: dict[float, tuple[float, float]], limit: float) -> Threshold:
    """Answer for the value, and again for the value shifted by twice its uncertainty either way."""
    answers = [_answer(worst, limit, errors) for errors in (0.0, -_SURE_ERRORS, _SURE_ERRORS)]
    return Threshold(
        falloff=limit,
        lowest_f_number=answers[0][0],
        from_f_number=answers[0][1],
        is_sure=len(set(answers)) == 1,
    )


def _answer(
    worst: dict[float, tuple[float, float]], limit: float, errors: float
) -> tuple[float | None, float | None]:
    below = {f_number: value + errors * u < limit for f_number, (value, u) in worst.items()}
    lowest = min((f_number for f_number, is_below in below.items() if is_below), default=None)
    highest_above = max((f_number for f_number, is_below in below.items() if not is_below), default=0.0)
    return lowest, min((f_number for f_number in below if f_number > highest_above), default=None)


def check_frames(candidates: Sequence[Candidate], rows: Sequence[FrameRow], params: Params) -> list[Raised]:
    flags = []
    for candidate in candidates:
        if candidate.quality is not None:
            flags += points.flag_frame(candidate.row.frame, candidate.quality)
        elif candidate.left_out:
            flags.append(codes.FLAT_LEFT_OUT.at(f"frame {candidate.row.frame}", f"{candidate.left_out}."))
    used = [candidate for candidate in candidates if not candidate.left_out]
    flags += flag_rendered([candidate.row.header.rendered for candidate in used])
    flags += flag_assumed_black([each.row.header for each in used])
    return flags + _check_darks(used) + _check_darkness(used, rows, params)


def _check_darkness(used: Sequence[Candidate], rows: Sequence[FrameRow], params: Params) -> list[Raised]:
    excluded = {exclusion.frame for exclusion in params.exclude}
    flags = []
    for iso in sorted({candidate.row.exposure.iso for candidate in used if candidate.row.exposure}):
        darks = [
            row
            for row in rows
            if row.role == results.DARK
            and row.frame not in excluded
            and row.exposure
            and row.exposure.iso == iso
        ]
        found = {row.frame: reason for row in darks if (reason := find_not_dark(row)) is not None}
        flags += flag_not_dark(found, f"iso {iso:g}")
    return flags


def _check_darks(used: Sequence[Candidate]) -> list[Raised]:
    flags = []
    for iso in sorted({candidate.row.exposure.iso for candidate in used if candidate.row.exposure}):
        lights = [
            candidate.light
            for candidate in used
            if candidate.light and candidate.row.exposure and candidate.row.exposure.iso == iso
        ]
        ratios = [light.dark_time_ratio for light in lights if light.dark_time_ratio is not None]
        where = f"iso {iso:g}"
        if not ratios:
            detail = "No dark frame of this ISO: the stated black level was subtracted."
            flags.append(shared.DARK_FROM_BLACK_LEVEL.at(where, detail))
            continue
        if max(ratios) > EXPOSURE_RATIO:
            far = [light for light in lights if (light.dark_time_ratio or 0.0) > EXPOSURE_RATIO]
            known = all(light.dark_times > 1 for light in far)
            current = (
                "is in the uncertainty, from the times that there are"
                if known
                else "is not known from one time, and not in the uncertainty"
            )
            detail = (
                f"Dark frames differ in exposure time by up to {max(ratios):.3g} times. How the dark level "
                f"grows {current}."
            )
            flags.append(shared.DARK_EXPOSURE_DIFFERS.at(where, detail))
    return flags


def check_fits(fitted: Fitted) -> list[Raised]:
    """Check the results, per f-number and channel, and from one f-number to the next."""
    flags = []
    for each in fitted:
        flags += _check_centre(each, fitted) + _check_shape(each)
    for channel in dict.fromkeys(each.fit.coefficient.channel for each in fitted):
        flags += _check_order([each for each in fitted if each.fit.coefficient.channel == channel])
    return flags


def _check_shape(each: FittedChannel) -> list[Raised]:
    flags, fit, where = [], each.fit, _where(each)
    gradient, u = fit.gradient_rel, fit.gradient_standard_uncertainty_rel
    if gradient > points.FLAGGED_GRADIENT_REL and each.solution.has_gradient:
        detail = f"The light changes by {gradient:.1%} across the frame, standard error {u:.1%}."
        flags.append(codes.UNEVEN_LIGHT.at(where, detail))
    if each.not_turned:
        detail = "Its plane differs from the one that the turned frames show: that one was not used."
        flags.append(codes.LIGHT_NOT_TURNED.at(where, detail))
    if fit.coefficient.model_u_rel > _MISFIT_REL:
        detail = f"Scatter beyond noise: {fit.coefficient.model_u_rel:.2%} of the light."
        flags.append(codes.VIGNETTING_MISFIT.at(where, detail))
    rise = find_rise(fit.coefficient)
    if rise is not None:
        detail = f"The light grows by {rise[0]:.1%} from r = {rise[1]:.2f} to {rise[2]:.2f}."
        flags.append(codes.FALLOFF_NOT_MONOTONIC.at(where, detail))
    return flags


def find_rise(coefficient: Coefficient) -> tuple[float, float, float] | None:
    """Return the outward increase of V and the two radii r from which and to which it extends.

    The error is that of the difference of V at the two radii, from the coefficients' covariance.
    """
    radii = falloff.sample_radii(farthest_radius(coefficient))
    rise, bottom, top = falloff.find_largest_rise(falloff.evaluate_curve(radii**2, coefficient.k))
    rows = coefficient.centre_row_px + coefficient.radius_px * radii[[bottom, top]]
    _, slopes = coefficient.evaluate(rows, np.array(coefficient.centre_col_px))
    by_k = slopes[:-2, 1] - slopes[:-2, 0]  # at given radii the centre does not enter
    error = math.hypot(
        float(falloff.propagate(by_k, np.array(coefficient.covariance)[:-2, :-2])), coefficient.model_u_rel
    )
    if rise <= max(_RISE, _ERRORS * error):
        return None
    return rise, float(radii[bottom]), float(radii[top])


def _check_centre(each: FittedChannel, fitted: Fitted) -> list[Raised]:
    """Check whether the flats determine the centre, and whether other apertures contradict it."""
    coefficient, where = each.fit.coefficient, _where(each)
    if each.fit.centre_held:
        detail = (
            f"A falloff of {each.fit.largest_falloff:.1%} does not separate the centre from uneven light. "
            f"It is taken to lie within {falloff.CENTRE_U:.0%} of the half diagonal of the middle, as a "
            "standard error."
        )
        return [codes.CENTRE_UNCERTAIN.at(where, detail)]
    best = find_best(other for other in fitted if other.fit.coefficient.channel == coefficient.channel)
    offset = np.array(each.alone.centre_px) - best.alone.centre_px
    apart = float(np.hypot(*offset))
    if apart <= _FAR_CENTRE * coefficient.radius_px:
        return []
    along, covariances = (
        offset / apart,
        (one.alone.find_covariance_of_lens()[-2:, -2:] for one in (each, best)),
    )
    error = math.hypot(*(math.sqrt(float(along @ covariance @ along)) for covariance in covariances))
    if apart <= _ERRORS * error:
        return []
    detail = f"The centre lies {apart:.0f} px from that of f/{best.fit.coefficient.f_number:g}."
    return [codes.CENTRE_UNCERTAIN.at(where, detail)]


def _check_order(fitted: Fitted) -> list[Raised]:
    """Compare each f-number of one channel with the next lower one."""
    flags = []
    for lower, higher in itertools.pairwise(fitted):
        one, other = lower.fit.coefficient, higher.fit.coefficient
        growth = other.corner_falloff - one.corner_falloff
        error = math.hypot(one.corner_falloff_standard_uncertainty, other.corner_falloff_standard_uncertainty)
        if growth > max(_RISE, _ERRORS * error):
            detail = f"The corner's falloff is {growth:.1%} larger than at f/{one.f_number:g}."
            flags.append(codes.FALLOFF_GROWS.at(_where(higher), detail))
    return flags


def _where(each: FittedChannel) -> str:
    return f"f/{each.fit.coefficient.f_number:g} {each.fit.coefficient.channel}"


def fit(rows: Sequence[FrameRow], params: Params) -> Fit:
    """Fit the falloff of every f-number and channel of a campaign's flat frames.

    The same input in any order gives the same result to the last bit. All numbers are finite; what does not
    exist is None.
    """
    evidence.require_complete(points.missing(rows, params))
    candidates = points.collect_candidates(rows, params)
    used = [candidate for candidate in candidates if not candidate.left_out]
    if not used:
        reasons = "; ".join(f"{each.row.frame}: {each.left_out}" for each in candidates)
        raise codes.FLAT_UNUSABLE.reject(f"No flat frame can be used. {reasons}.")
    points.require_one_lens(candidates)
    fitted = _fit_all(candidates, params)
    return Fit(
        height_px=fitted[0].fit.coefficient.height_px,
        width_px=fitted[0].fit.coefficient.width_px,
        cfa=next(each.row.features.cfa for each in used if each.row.features is not None),
        channel_fits=tuple(each.fit for each in fitted),
        thresholds=find_thresholds(fitted),
        points=points.describe_points(rows, candidates, params),
        flags=(*check_frames(candidates, rows, params), *check_fits(fitted)),
        conventions=Conventions.of(max(len(each.fit.coefficient.k) for each in fitted)),
    )


def _fit_all(candidates: Sequence[Candidate], params: Params) -> list[FittedChannel]:
    """Fit every f-number and channel, then again with the centre that one f-number determines best."""
    turns = _find_turns(candidates, params)
    groups: dict[tuple[str, float], list[tuple[falloff.Blocks, float]]] = {}
    for candidate in candidates:
        if candidate.light is not None and not candidate.left_out:
            for light in candidate.channels:
                group = groups.setdefault((light.channel, candidate.light.f_number), [])
                group.append((light.blocks, turns[candidate.row.frame]))

    def fit_one(key: tuple[str, float], known: falloff.Solution | None = None) -> FittedChannel:
        flats, turned = zip(*groups[key], strict=True)
        return fit_channel(flats, channel=key[0], f_number=key[1], turns_deg=turned, known=known)

    fitted = {key: fit_one(key) for key in groups}
    best = {channel: find_best(fitted[key] for key in groups if key[0] == channel) for channel, _ in groups}
    return [
        each if each is best[key[0]] else fit_one(key, best[key[0]].alone)
        for key, each in sorted(fitted.items(), key=lambda pair: pair[0][1])
    ]


def _find_turns(candidates: Sequence[Candidate], params: Params) -> dict[str, float]:
    """Return the angle by which the camera was turned at each flat, by the order at its f-number [deg]."""
    taken: Counter[float] = Counter()
    turns = {}
    for each in sorted(candidates, key=lambda one: (one.row.header.taken_at or "", one.row.frame)):
        f_number = each.row.exposure.f_number if each.row.exposure else 0.0
        turns[each.row.frame] = taken[f_number] * (params.flats_turned_deg or 0.0)
        taken[f_number] += 1
    return turns


def list_coefficients(fit: Fit) -> tuple[evidence.CoefficientValue, ...]:
    return tuple(
        evidence.CoefficientValue(
            name=name,
            value=quantity.value,
            standard_uncertainty=quantity.standard_uncertainty,
            unit=quantity.unit,
            model=write_equation(len(coefficient.k)),
            f_number=coefficient.f_number,
            band=None if coefficient.channel in CHANNELS else coefficient.channel,
            channel=coefficient.channel,
            flags=_flags_of(fit, coefficient),
            effective_dof=each.effective_dof.get(name, evidence.MOST_DOF) if each.effective_dof else None,
        )
        for each in fit.channel_fits
        for coefficient in (each.coefficient,)
        for name, quantity in _list_quantities(coefficient).items()
    )


def _list_quantities(coefficient: Coefficient) -> dict[str, evidence.Quantity]:
    values = {
        **{f"k{n}": (each, "1") for n, each in enumerate(coefficient.k, 1)},
        "centre_row_px": (coefficient.centre_row_px, "px"),
        "centre_col_px": (coefficient.centre_col_px, "px"),
    }
    quantities = {
        name: evidence.Quantity(value, coefficient.covariance[index][index] ** 0.5, unit)
        for index, (name, (value, unit)) in enumerate(values.items())
    }
    quantities["corner_falloff"] = evidence.Quantity(
        coefficient.corner_falloff, coefficient.corner_falloff_standard_uncertainty, "1"
    )
    return quantities


def _flags_of(fit: Fit, coefficient: Coefficient) -> tuple[str, ...]:
    f_number = coefficient.f_number
    frames = {f"frame {point.frame}" for point in fit.points if point.f_number == f_number}
    wheres = {"", f"f/{f_number:g} {coefficient.channel}", *frames}
    isos = {raised.flag for raised in fit.flags if raised.where.startswith("iso ")}
    return tuple(sorted({raised.flag for raised in fit.flags if raised.where in wheres} | isos))
