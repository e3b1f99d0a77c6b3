"""Blooming: what a saturated spot adds to its neighbours, by direction and distance."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from radiometry.fitting.evidence import MOST_DOF, Quantity
from radiometry.fitting.repeats import merge_variances
from radiometry.sharpness.sampling import Matrix
from radiometry.sharpness.spots import STRIP_REL, SpotResponse
from radiometry.specification.stored import LATER

SATURATED_RATIO: Final = 1.1
"""A spot is saturated where the unsaturated picture predicts a tenth more than is seen."""
SHOWN_PX: Final = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
REACH_REL: Final = 0.01
_LEAST_RATIO: Final = 2.0


@dataclass(frozen=True, kw_only=True)
class SpotShot:
    """Spot of one frame with its exposure."""

    frame: str
    position: str
    f_number: float
    iso: float
    exposure_time_s: float
    spot: SpotResponse


@dataclass(frozen=True, kw_only=True)
class Added:
    """Signal that a spot adds at a distance from where light alone saturates, relative to saturation."""

    distance_px: float
    added_rel: float
    standard_uncertainty_rel: float


@dataclass(frozen=True, kw_only=True)
class Blooming:
    """Blooming of one spot in one direction.

    Attributes
    ----------
    position, channel, direction : str
        Position, channel, and direction in the frame.
    f_number, iso, exposure_time_s : float
        Settings of the saturated pictures.
    overexposure : float
        Light in the middle of the spot over that which saturates.
    blooming : Quantity
        Sum of what is added over all distances, as a length of saturated pixels.
    reach_px : float
        Distance from where light alone saturates to where less than 1 % is added [px].
    added : tuple of Added
        What is added against the distance.
    effective_dof : float or None
        Effective degrees of freedom of `blooming`; None in versions from before they were computed.
    frames, references : tuple of str
        Saturated and unsaturated frames.
    """

    position: str
    channel: str
    direction: str
    f_number: float
    iso: float
    exposure_time_s: float
    overexposure: float
    blooming: Quantity
    reach_px: float
    added: tuple[Added, ...]
    frames: tuple[str, ...]
    references: tuple[str, ...]
    effective_dof: float | None = field(default=None, metadata=LATER)


def fit_blooming(
    shots: Sequence[SpotShot], *, ratio_u_rel: float, black_u_dn: float
) -> tuple[tuple[Blooming, ...], dict[tuple[str, str, str], str]]:
    """Compare saturated pictures of a spot with what an unsaturated one predicts.

    Parameters
    ----------
    shots : sequence of SpotShot
        Spots of all frames.
    ratio_u_rel : float
        Relative standard uncertainty of the ratio of two exposure times.
    black_u_dn : float
        Standard uncertainty of the black level [DN].

    Returns
    -------
    tuple of (tuple of Blooming, dict)
        Results, and the reason why a spot gives none by frame, position and channel.

    Notes
    -----
    With S the signal above black, Q that in the middle of the saturated spot and rho the ratio of the
    exposure times, light alone would show min(rho S_ref, Q). Lens halo and glare are in both, and cancel::

        added = min(S, Q) - min(rho S_ref, Q)        blooming = pitch sum(added) / Q
        u(added)^2 = u(S)^2 + (rho u(S_ref))^2 + (rho S_ref u(rho)/rho)^2 + ((rho - 1) u(black))^2

    where the last two are shared by all places and add linearly in the sum. Several frames of one setting
    are averaged: where their sums scatter beyond that, as by a lamp that changes between them, u follows
    from the scatter with Student's factor. The reference is the longest exposure of at most half of the
    saturated one that is not saturated itself. Degrees of freedom are those of the samples across a strip.
    """
    found: list[Blooming] = []
    why: dict[tuple[str, str, str], str] = {}

    def where(shot: SpotShot) -> tuple[str, str, float, float, tuple[int, ...]]:
        places = tuple(len(arm.distance_px) for arm in shot.spot.arms)
        return shot.position, shot.spot.channel, shot.f_number, shot.iso, places

    for _, group in itertools.groupby(
        sorted(shots, key=lambda shot: (*where(shot), shot.exposure_time_s)), where
    ):
        settings = [list(same) for _, same in itertools.groupby(group, lambda shot: shot.exposure_time_s)]
        for number, frames in enumerate(settings):
            reference = _find_reference(settings[:number], frames)
            if reference is None:
                continue
            found += [
                _compare(frames, reference, arm, ratio_u_rel=ratio_u_rel, black_u_dn=black_u_dn)
                for arm in range(len(frames[0].spot.arms))
            ]
        used = {frame for each in found for frame in (*each.frames, *each.references)}
        why |= {
            (
                shot.frame,
                shot.position,
                shot.spot.channel,
            ): "no picture of this spot at another exposure time, the "
            "same ISO value and f-number is saturated here, or shows it unsaturated there"
            for frames in settings
            for shot in frames
            if shot.frame not in used
        }
    return tuple(found), why


def _average(frames: Sequence[SpotShot], arm: int) -> tuple[Matrix, Matrix]:
    """Return signal and its standard uncertainty, from the larger of noise and the scatter of repeats."""
    signals = _stack(frames, arm)
    noise = np.mean(np.array([shot.spot.arms[arm].u_dn for shot in frames]) ** 2, axis=0)
    scatter = signals.var(axis=0, ddof=1) if len(frames) > 1 else np.zeros_like(noise)
    return signals.mean(axis=0), np.sqrt(np.maximum(noise, scatter) / len(frames))


def _stack(frames: Sequence[SpotShot], arm: int) -> Matrix:
    return np.array([shot.spot.arms[arm].signal_dn for shot in frames])


def _middle(frames: Sequence[SpotShot]) -> float:
    return float(np.mean([_average(frames, arm)[0][:2] for arm in range(len(frames[0].spot.arms))]))


def _find_reference(shorter: Sequence[list[SpotShot]], frames: Sequence[SpotShot]) -> list[SpotShot] | None:
    """Return the longest unsaturated setting; the shortest of all is taken as unsaturated."""
    if not shorter:
        return None
    time_s, level = frames[0].exposure_time_s, _middle(frames)
    base = shorter[0]
    if _middle(base) * time_s / base[0].exposure_time_s < SATURATED_RATIO * level:
        return None
    for each in reversed(shorter):
        ratio = each[0].exposure_time_s / base[0].exposure_time_s
        linear = _middle(base) * ratio < SATURATED_RATIO * _middle(each)
        if (
            linear
            and _middle(each) < level / SATURATED_RATIO
            and time_s / each[0].exposure_time_s >= _LEAST_RATIO
        ):
            return each
    return None


def _sum_noise(signals: Matrix, u: Matrix) -> tuple[float, float]:
    """Return u of the sum over all places, and its degrees of freedom; repeats may change as a whole.

    ``signals`` : (frame, place); ``u`` : of their mean at each place
    """
    by_noise = float((u**2).sum())
    # a strip is as wide as its arm is long times 4 of its share
    across = max(1.0, 4.0 * STRIP_REL * u.size - 1.0)
    dof = across * len(signals) * by_noise**2 / float((u**4).sum()) if by_noise else math.inf
    sums = signals.sum(axis=1)
    if len(sums) == 1:
        return math.sqrt(by_noise), dof
    return merge_variances(float(sums.var(ddof=1)), by_noise * len(sums), len(sums), dof=dof)


def _compare(
    frames: Sequence[SpotShot],
    reference: Sequence[SpotShot],
    arm: int,
    *,
    ratio_u_rel: float,
    black_u_dn: float,
) -> Blooming:
    first = frames[0]
    shown = first.spot.arms[arm]
    distance = np.array(shown.distance_px)
    signal, u = _average(frames, arm)
    dim, u_dim = _average(reference, arm)
    rho = first.exposure_time_s / reference[0].exposure_time_s
    level = _middle(frames)
    light = rho * dim
    open_ = light < level
    added = np.where(open_, np.minimum(signal, level) - np.minimum(light, level), 0.0)
    noise = np.where(open_, np.hypot(np.where(signal < level, u, 0.0), rho * u_dim), 0.0)
    shared = np.array(
        [np.where(open_, light * ratio_u_rel, 0.0), np.where(open_, (rho - 1.0) * black_u_dn, 0.0)]
    )
    pitch = float(np.mean(np.diff(distance)))
    below = open_ & (signal < level)
    parts = [
        _sum_noise(np.where(below, _stack(frames, arm), 0.0), np.where(below, u, 0.0)),
        _sum_noise(np.where(open_, rho * _stack(reference, arm), 0.0), np.where(open_, rho * u_dim, 0.0)),
    ]
    total = math.sqrt(sum(each**2 for each, _ in parts) + float((shared.sum(axis=1) ** 2).sum()))
    doubt = sum(each**4 / dof for each, dof in parts)
    edge = float(distance[open_][0]) if open_.any() else float(distance[-1])
    u_place = np.sqrt(noise**2 + (shared**2).sum(axis=0))
    beyond = distance[open_ & (added > np.maximum(REACH_REL * level, 2.0 * u_place))]
    return Blooming(
        position=first.position,
        channel=first.spot.channel,
        direction=shown.direction,
        f_number=first.f_number,
        iso=first.iso,
        exposure_time_s=first.exposure_time_s,
        overexposure=_middle(reference) * rho / level,
        blooming=Quantity(
            value=pitch * float(added.sum()) / level, standard_uncertainty=pitch * total / level, unit="px"
        ),
        reach_px=max(0.0, float(beyond[-1]) - edge + pitch) if len(beyond) else 0.0,
        added=tuple(
            Added(
                distance_px=step,
                added_rel=float(np.interp(edge + step, distance, added)) / level,
                standard_uncertainty_rel=float(np.interp(edge + step, distance, u_place)) / level,
            )
            for step in SHOWN_PX
            if edge + step <= distance[-1]
        ),
        frames=tuple(shot.frame for shot in frames),
        references=tuple(shot.frame for shot in reference),
        effective_dof=min(MOST_DOF, total**4 / doubt) if doubt else MOST_DOF,
    )
