"""Stability of the orientation of a rig over several sets of pictures."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

import numpy as np

from radiometry.fitting.evidence import Quantity
from radiometry.fleet.determinations import Determination, Key, LeftOut, Source
from radiometry.fleet.line import DAYS_PER_YEAR, Stability, fit_line, judge_stability, say_stability
from radiometry.specification.rig import RigMember


@dataclass(frozen=True, kw_only=True)
class RigStability:
    """One number of the orientation of one camera over several sets. What does not exist is None.

    Attributes
    ----------
    camera, name : str
        Serial number of the camera, and the number: yaw, pitch, roll, x, y or z.
    sets : int
        Number of sets.
    mean : Quantity
        Mean of the sets, with its standard uncertainty.
    repeatability : Quantity or None
        Standard deviation of one set; None for one.
    slope : Quantity or None
        Trend per year; None for fewer than three sets at different times.
    change : Quantity or None
        Of the trend from the first set to the last.
    verdict : {"stable", "drifts", "cannot_tell"}
        Verdict on the change, as on the coefficients of one camera.
    said : str
        The verdict in words.
    """

    camera: str
    name: str
    sets: int
    mean: Quantity
    repeatability: Quantity | None
    slope: Quantity | None
    change: Quantity | None
    verdict: Stability
    said: str


@dataclass(frozen=True, kw_only=True)
class RigVersion:
    """Version of one camera of a rig, with its time."""

    version: str
    at: datetime
    member: RigMember


def group_sets(
    cameras: Sequence[Sequence[RigVersion]], count_shared: Callable[[RigMember, RigMember], int]
) -> tuple[tuple[tuple[RigVersion, ...], ...], tuple[LeftOut, ...]]:
    """Group versions by the triggers that their pictures share.

    Parameters
    ----------
    cameras : sequence of sequence of RigVersion
        Versions of each camera, one per campaign, the reference first.
    count_shared : callable
        ``(member, member) -> int``, how many triggers have a picture of both.

    Returns
    -------
    tuple of (tuple of tuple of RigVersion, tuple of LeftOut)
        Sets in time, one version of each camera in each, and versions that are in none.

    Notes
    -----
    Each version of the reference takes, of every other camera, the version that shares most triggers with
    it, of equally many the nearest in time: triggers of two days may have the same names.
    """
    free = [list(each) for each in cameras[1:]]
    sets, why = [], []
    for first in sorted(cameras[0], key=lambda each: (each.at, each.version)):
        members = [first]
        for versions in free:
            shared = {each.version: count_shared(first.member, each.member) for each in versions}
            best = min(
                versions,
                key=lambda each: (-shared[each.version], abs(each.at - first.at), each.version),
                default=None,
            )
            if best is not None and shared[best.version]:
                members.append(best)
        if len(members) < len(cameras):
            why.append(
                LeftOut(version=first.version, why="No version of every other camera shares its triggers.")
            )
            continue
        for versions, member in zip(free, members[1:], strict=True):
            versions.remove(member)
        sets.append(tuple(members))
    why += [
        LeftOut(
            version=each.version,
            why="No version of the reference shares its triggers, or another shares more.",
        )
        for versions in free
        for each in versions
    ]
    return tuple(sets), tuple(why)


def compare_sets(
    sets: Sequence[tuple[datetime, Mapping[tuple[str, str], Quantity]]], *, limits: Mapping[str, float]
) -> tuple[RigStability, ...]:
    """Compare the orientations of several sets, number by number.

    Parameters
    ----------
    sets : sequence of tuple of (datetime, mapping)
        Time and numbers of each set, by camera and name.
    limits : mapping
        Largest accepted change from the first set to the last, by unit.

    Returns
    -------
    tuple of RigStability
        Results by camera and name.
    """
    found: dict[tuple[str, str], list[tuple[datetime, Quantity]]] = {}
    for at, numbers in sorted(sets, key=lambda each: each[0]):
        for key, quantity in numbers.items():
            found.setdefault(key, []).append((at, quantity))
    return tuple(_compare(camera, name, rows, limits) for (camera, name), rows in found.items())


def _compare(
    camera: str, name: str, found: Sequence[tuple[datetime, Quantity]], limits: Mapping[str, float]
) -> RigStability:
    unit = found[0][1].unit
    limit = limits.get(unit)
    rows = [
        Determination(
            key=Key(name=name, unit=unit, model="rig"),
            value=quantity.value,
            standard_uncertainty=quantity.standard_uncertainty,
            source=Source(version=str(number), camera=camera, lens=None, campaign=str(number), at=at),
        )
        for number, (at, quantity) in enumerate(found)
    ]
    count, values = len(rows), np.array([row.value for row in rows])
    spread = float(values.std(ddof=1)) if count > 1 else None
    stated = math.sqrt(sum(row.standard_uncertainty**2 for row in rows)) / count
    line = fit_line(rows)
    span_days = (rows[-1].source.at - rows[0].source.at) / timedelta(days=1)
    verdict, change, error = judge_stability(line, span_days, limit=limit)

    def state(value: float | None, u: float | None, per: str = "") -> Quantity | None:
        known = value is not None and u is not None
        return Quantity(value=value, standard_uncertainty=u, unit=f"{unit}{per}") if known else None  # type: ignore[arg-type]

    return RigStability(
        camera=camera,
        name=name,
        sets=count,
        mean=Quantity(
            value=float(values.mean()),
            standard_uncertainty=max(stated, (spread or 0.0) / math.sqrt(count)),
            unit=unit,
        ),
        repeatability=state(spread, None if spread is None else spread / math.sqrt(2.0 * (count - 1))),
        slope=state(
            DAYS_PER_YEAR * line.slope_per_day if line else None,
            DAYS_PER_YEAR * math.sqrt(line.covariance[1][1]) if line else None,
            "/a",
        ),
        change=state(change, error),
        verdict=verdict,
        said=say_stability(
            verdict, with_limit=limit is not None, repeats=len({row.source.at for row in rows})
        ),
    )
