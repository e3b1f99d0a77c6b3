"""The fit of a campaign: its frames, every channel at every ISO value, flags and coefficients."""

import math
from collections.abc import Sequence

from radiometry.findings import Finding, Raised, grouping, shared
from radiometry.fitting.evidence import MOST_DOF, CoefficientValue, Quantity, require_complete
from radiometry.frame import statistics, verdicts
from radiometry.noise import codes, results
from radiometry.noise.channels import FittedChannel, fit_channel
from radiometry.noise.results import ChannelFit, Fit, FrameRow, Params, Point
from radiometry.noise.stacks import Stack, group_by_channel, make_stacks
from radiometry.noise.transfer import FEWEST_LEVELS, find_not_dark
from radiometry.specification.certificate import CoefficientKind


def collect_stacks(rows: Sequence[FrameRow], params: Params) -> dict[tuple[float, str], list[Stack]]:
    """Return the stacks of the frames that are not excluded, by ISO value and channel."""
    excluded = {exclusion.frame for exclusion in params.exclude}
    return group_by_channel(make_stacks([row for row in rows if row.frame not in excluded]))


def missing(rows: Sequence[FrameRow], params: Params, *, unread: Sequence[str] = ()) -> tuple[str, ...]:
    excluded = {exclusion.frame for exclusion in params.exclude}
    here = [row for row in rows if row.frame not in excluded]
    waiting = [row.frame for row in here if row.features is None]
    lacking: list[str] = [
        grouping.name_frames(what, group, finding)
        for group, what, finding in (
            (unread, "not read yet", shared.NOT_READ),
            (waiting, "not extracted yet", shared.NOT_EXTRACTED),
        )
        if group
    ]
    if lacking:
        return tuple(lacking)
    by_channel = collect_stacks(rows, params)
    complaints = [_complain(iso, channel, stacks) for (iso, channel), stacks in by_channel.items()]
    if not complaints:
        return ("no frame: take pairs of dark and of evenly lit frames at several exposure times",)
    # one channel at one ISO value is enough to start
    return () if "" in complaints else tuple(dict.fromkeys(complaints))


def _complain(iso: float, channel: str, stacks: Sequence[Stack]) -> str:
    """Return what one channel lacks; "" if a photon transfer can be tried."""
    paired = [stack for stack in stacks if stack.temporal is not None]
    if not any(stack.setting.role == results.DARK for stack in paired):
        return f"ISO {iso:g} has no pair of dark frames of one exposure time"
    levels = sum(stack.setting.role != results.DARK and not stack.clipped for stack in paired)
    if levels < FEWEST_LEVELS:
        return (
            f"ISO {iso:g} {channel} has pairs of frames at {levels} light levels below white: "
            f"at least {FEWEST_LEVELS}"
        )
    return ""


def describe_points(
    rows: Sequence[FrameRow], stacks: Sequence[Stack], fitted: Sequence[FittedChannel], params: Params
) -> tuple[Point, ...]:
    """Return, for every channel of every frame, whether it was used."""
    excluded = {each.frame: f"excluded by {each.by}: {each.reason}" for each in params.exclude}
    states = _judge_stacks(stacks, fitted)
    points = []
    for row in sorted(rows, key=lambda row: row.frame):
        reason = excluded.get(row.frame) or ("" if row.features and row.exposure else "not extracted")
        if reason:
            points.append(_describe(row, None, "", reason))
            continue
        own = [stack for stack in stacks if row.frame in stack.frames or row.frame in stack.copies]
        for stack in own:
            original = stack.copies.get(row.frame)
            why = f"its samples are those of {original}: a copy" if original else states[stack.setting]
            points.append(_describe(row, stack, stack.setting.channel, why))
    return tuple(points)


def _judge_stacks(stacks: Sequence[Stack], fitted: Sequence[FittedChannel]) -> dict[object, str]:
    """Return, for every stack, the reason why nothing was evaluated from it, "" if something was."""
    states: dict[object, str] = {
        stack.setting: "" if stack.setting.role == results.DARK else "no pair of dark frames at its ISO"
        for stack in stacks
    }
    for each in fitted:
        for level, result in zip(each.levels, each.fit.levels, strict=True):
            used = not result.left_out or result.deviation_rel is not None
            states[level.lit.setting] = "" if used else result.left_out
    return states


def _describe(row: FrameRow, stack: Stack | None, channel: str, left_out: str) -> Point:
    exposure = row.exposure
    mean = None
    if stack is not None and row.frame in stack.frames:
        mean = stack.frame_means_dn[stack.frames.index(row.frame)]
    return Point(
        frame=row.frame,
        channel=channel,
        role=row.role,
        scene=row.scene,
        iso=exposure.iso if exposure else None,
        f_number=exposure.f_number if exposure else None,
        exposure_time_s=exposure.exposure_time_s if exposure else None,
        mean_dn=mean,
        clipped_share=stack.clipped_share if stack else None,
        frames_of_setting=len(stack.frames) if stack else 0,
        used=not left_out,
        left_out=left_out,
    )


GOOD_LEVELS = 6
DRIFT_REL = 0.01
TIME_RATIO = 2.0
UNDERFLOW_SHARE = 0.005  # EMVA 1288, 6.5: no more samples of a dark frame may be zero

# Nominal shutter times err by up to 7 %, 1/60 s for 1/64 s, and sensors bend by a few per cent
OFF_LINE_REL = 0.1

UNEVEN_REL = 0.05  # Sensors have 0.3 to 2 %

_ERRORS = 3.0


def check_fits(fitted: Sequence[FittedChannel]) -> tuple[Raised, ...]:
    found: list[Raised] = []
    for each in fitted:
        where = f"iso {each.fit.iso:g} {each.fit.channel}"
        for flag, detail in (*_check_stacks(each), *_check_transfer(each), *_check_figures(each)):
            found.append(flag.at(where, detail))
    return tuple(found)


def check_headers(rows: Sequence[FrameRow]) -> tuple[Raised, ...]:
    """Check for rendered frames, whose tone curve lies between light and numbers, and for black levels."""
    found = verdicts.flag_rendered([row.header.rendered for row in rows])
    return (*found, *verdicts.flag_assumed_black([row.header for row in rows]))


def _check_stacks(each: FittedChannel) -> list[tuple[Finding, str]]:
    found = []
    drifting = max((level.lit.drift_rel for level in each.levels), default=0.0)
    if drifting > DRIFT_REL:
        detail = f"The means of frames of one setting differ by up to {drifting:.1%}."
        found.append((codes.PAIR_LIGHT_DRIFT, detail))
    ratios = [level.time_ratio for level in each.levels if not level.left_out]
    if max(ratios, default=1.0) > TIME_RATIO:
        found.append((shared.DARK_EXPOSURE_DIFFERS, f"By up to a factor of {max(ratios):.3g}."))
    darks = [stack for stack in each.stacks if stack.setting.role == results.DARK]
    doubted = {frame: why for stack in darks for frame, why in find_not_dark(stack).items()}
    if doubted:
        found.append((shared.DARK_NOT_DARK, verdicts.name_not_dark(doubted)))
    zeros = max(stack.zero_share for stack in darks)
    if zeros > UNDERFLOW_SHARE:
        found.append((codes.DARK_CLIPPED, f"Up to {zeros:.1%} of a dark frame's samples are 0."))
    return found


def _check_transfer(each: FittedChannel) -> list[tuple[Finding, str]]:
    transfer = each.transfer
    if transfer is None:
        usable = sum(not level.left_out for level in each.levels)
        return [(codes.NO_PHOTON_TRANSFER, f"Usable levels: {usable} of {len(each.levels)}.")]
    found = []
    if len(transfer.levels) < GOOD_LEVELS:
        found.append((shared.FEW_POINTS, f"Levels in the photon transfer: {len(transfer.levels)}."))
    dof = len(transfer.levels) - 1
    # chance exceeds mean plus three standard deviations once in several hundred times
    if transfer.birge_ratio > 1.0 and transfer.chi_squared > dof + 3.0 * math.sqrt(2.0 * dof):
        detail = f"Birge ratio {transfer.birge_ratio:.3f}: the noise does not follow the photon transfer."
        found.append((shared.SCATTER_EXCEEDS_UNCERTAINTY, detail))
    line = each.fit.linearity
    if line and max(-line.lowest_rel, line.highest_rel) > OFF_LINE_REL:
        detail = f"Levels lie {line.lowest_rel:+.1%} to {line.highest_rel:+.1%} off the line."
        found.append((codes.LINEARITY_ERROR_LARGE, detail))
    figures = each.fit.transfer
    if figures and figures.saturation_origin == "white_level_assumed":
        top = max((level.signal_dn for level in each.levels), default=0.0)
        found.append(
            (
                codes.FULL_WELL_NOT_REACHED,
                f"The brightest level is {top / figures.saturation_dn.value:.0%} of white.",
            )
        )
    return found


def _check_figures(each: FittedChannel) -> list[tuple[Finding, str]]:
    fit, found = each.fit, []
    if each.rounding_dominates:
        low, high = (
            max(0.0, fit.read_noise_dn.value + side * 1.96 * fit.read_noise_dn.standard_uncertainty)
            for side in (-1.0, 1.0)
        )
        detail = f"It lies between {low:.2g} and {high:.2g} DN with a probability of 95 %."
        found.append((codes.READ_NOISE_BELOW_ROUNDING, detail))
    if fit.prnu_rel and fit.prnu_rel.value > UNEVEN_REL:
        found.append((codes.PRNU_LARGE, f"PRNU {fit.prnu_rel.value:.1%}."))
    names = [
        name
        for name, resolved in (("DSNU", each.dsnu_resolved), ("PRNU", each.prnu_resolved))
        if not resolved
    ]
    if names:
        found.append((codes.PATTERN_NOT_RESOLVED, f"{' and '.join(names)}: add frames of one setting."))
    current = fit.dark_current
    mean = current.dark_current_e_per_s if current else None
    variance = current.from_variance_e_per_s if current else None
    if mean and variance:
        u = math.hypot(mean.standard_uncertainty, variance.standard_uncertainty)
        if variance.value - mean.value > _ERRORS * u:
            detail = f"From the mean {mean.value:.3g} e-/s, from the variance {variance.value:.3g} e-/s."
            found.append((codes.DARK_CURRENT_COMPENSATED, detail))
    return found


COEFFICIENTS = (
    CoefficientKind(name="system_gain_dn_per_e", label="System gain", units=("DN/e-",)),
    CoefficientKind(name="read_noise_e", label="Read noise", units=("e-",)),
    CoefficientKind(name="read_noise_dn", label="Read noise", units=("DN",)),
    CoefficientKind(name="full_well_e", label="Saturation capacity", units=("e-",)),
    CoefficientKind(name="linearity_error_rel", label="Linearity error", units=("1",)),
    CoefficientKind(name="snr_max", label="Largest signal-to-noise ratio", units=("1",)),
    CoefficientKind(name="dynamic_range_db", label="Dynamic range", units=("dB",)),
    CoefficientKind(name="dynamic_range_stops", label="Dynamic range", units=("stop",)),
    CoefficientKind(name="dark_current_e_per_s", label="Dark current", units=("e-/s",)),
    CoefficientKind(name="dark_current_dn_per_s", label="Dark current", units=("DN/s",)),
    CoefficientKind(name="dsnu_e", label="Dark signal nonuniformity", units=("e-",)),
    CoefficientKind(name="dsnu_dn", label="Dark signal nonuniformity", units=("DN",)),
    CoefficientKind(name="prnu_rel", label="Photo response nonuniformity", units=("1",)),
)
FIGURES = tuple(each.name for each in COEFFICIENTS)


def fit(rows: Sequence[FrameRow], params: Params) -> Fit:
    """Evaluate every channel at every ISO value of a campaign.

    The same input in any order gives the same result to the last bit. All numbers are finite; what does not
    exist is None.
    """
    require_complete(missing(rows, params))
    by_channel = collect_stacks(rows, params)
    fitted = [each for stacks in by_channel.values() if (each := fit_channel(stacks, params))]
    if not any(each.transfer for each in fitted):
        reasons = dict.fromkeys(level.left_out for each in fitted for level in each.fit.levels)
        raise shared.FIT_FAILED.reject(
            "No channel's noise grows with its signal over three levels or more, so there is no system gain. "
            f"Left out: {'; '.join(reason for reason in reasons if reason) or 'nothing'}."
        )
    stacks = [stack for group in by_channel.values() for stack in group]
    return Fit(
        channel_fits=tuple(each.fit for each in fitted),
        points=describe_points(rows, stacks, fitted, params),
        flags=(*check_headers(rows), *check_fits(fitted)),
    )


def list_coefficients(fit: Fit) -> tuple[CoefficientValue, ...]:
    return tuple(
        CoefficientValue(
            name=name,
            value=quantity.value,
            standard_uncertainty=quantity.standard_uncertainty,
            unit=quantity.unit,
            model=results.TRANSFER_EQUATION,
            iso=channel.iso,
            band=None if channel.channel in statistics.CHANNELS else channel.channel,
            channel=channel.channel,
            flags=_flags_of(fit, channel),
            effective_dof=channel.effective_dof.get(name, MOST_DOF) if channel.effective_dof else None,
        )
        for channel in fit.channel_fits
        for quantities in (_list_quantities(channel),)
        for name in FIGURES
        if (quantity := quantities.get(name)) is not None
    )


def _list_quantities(channel: ChannelFit) -> dict[str, Quantity | None]:
    parts = (channel, channel.transfer, channel.dark_current)
    found = {name: getattr(part, name) for part in parts for name in FIGURES if hasattr(part, name)}
    return {**found, "linearity_error_rel": channel.linearity.error_rel if channel.linearity else None}


def _flags_of(fit: Fit, channel: ChannelFit) -> tuple[str, ...]:
    wheres = {"", f"iso {channel.iso:g} {channel.channel}"}
    return tuple(sorted({raised.flag for raised in fit.flags if raised.where in wheres}))
