"""Flags on the repeats that a verdict is based on."""

from collections.abc import Sequence
from datetime import timedelta

import numpy as np
import scipy

from radiometry.findings import Raised
from radiometry.fleet import codes
from radiometry.fleet.determinations import Determination
from radiometry.fleet.effects import Effects
from radiometry.fleet.grouping import Grouping

_CHANCE = 0.01
_ONE_DAY = timedelta(days=1)


def find_flags(rows: Sequence[Determination], grouping: Grouping, effects: Effects) -> tuple[Raised, ...]:
    """Find reasons why the true repeatability may differ from the estimate.

    Parameters
    ----------
    rows : sequence of Determination
        Values of one parameter.
    grouping : Grouping
        Factors of the analysis.
    effects : Effects
        The solved model.

    Returns
    -------
    tuple of Raised
        repeats_exceed_uncertainty where dof MS_w > chi^2_dof,0.99 mean(u^2); repeats_of_one_day;
        body_and_lens_confounded.
    """
    where = str(rows[0].key)
    found = []
    stated = float(np.mean([row.standard_uncertainty**2 for row in rows]))
    if effects.dof > 0 and stated > 0.0:
        ratio = effects.within_variance / stated
        if ratio > float(scipy.special.chdtri(effects.dof, _CHANCE)) / effects.dof:
            found.append(
                codes.REPEATS_EXCEED_UNCERTAINTY.at(
                    where,
                    f"Repeats scatter {ratio**0.5:.2g} times as much as their standard uncertainties.",
                )
            )
    if effects.dof > 0 and _are_of_one_day(rows):
        found.append(codes.REPEATS_OF_ONE_DAY.at(where, "All repeats of each camera lie within 24 hours."))
    if grouping.confounded:
        found.append(
            codes.BODY_AND_LENS_CONFOUNDED.at(
                where,
                f"{len(grouping.unit_names)} pairs of body and lens, and no swaps that link them all.",
            )
        )
    return tuple(found)


def _are_of_one_day(rows: Sequence[Determination]) -> bool:
    times: dict[str, list[float]] = {}
    for row in rows:
        times.setdefault(row.source.camera, []).append(row.source.at.timestamp())
    return all(max(found) - min(found) <= _ONE_DAY.total_seconds() for found in times.values())
