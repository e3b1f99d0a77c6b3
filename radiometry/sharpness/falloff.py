"""Decrease of sharpness from the middle of the frame to its corners."""

import itertools
import math
from collections.abc import Sequence

from radiometry.fitting.evidence import MOST_DOF, Quantity
from radiometry.sharpness.candidates import MTF50, RESOLVING_POWER
from radiometry.sharpness.results import Coefficient, Falloff, FalloffTable, PositionFit

CENTRE_RADIUS_REL = 0.25
CORNER_RADIUS_REL = 0.6


def compare_positions(positions: Sequence[PositionFit]) -> tuple[FalloffTable, ...]:
    """Compute the falloff of every channel and f-number that has a position in the middle and one elsewhere.

    Parameters
    ----------
    positions : sequence of PositionFit
        Results of all positions.

    Returns
    -------
    tuple of FalloffTable
        Falloff by channel and f-number.

    Notes
    -----
    ratio = m / m_c, m_c the mean over positions within a quarter of the half diagonal; the corner's is the
    mean over positions beyond 0.6 of it. Uncertainties of different positions are taken as independent: the
    focus, which positions of one frame share, is in the repeatability of each.
    """

    def group_of(each: PositionFit) -> tuple[str, str, float]:
        return each.kind, each.channel, each.f_number or 0.0

    tables = []
    for _, found in itertools.groupby(sorted(positions, key=group_of), key=group_of):
        table = _compare(list(found))
        if table is not None:
            tables.append(table)
    return tuple(tables)


def _compare(positions: Sequence[PositionFit]) -> FalloffTable | None:
    figure = MTF50 if positions[0].kind == "slanted_edge" else RESOLVING_POWER
    measured = [
        (each, coefficient)
        for each in sorted(positions, key=lambda one: (one.radius_rel, one.position))
        if (coefficient := each.find(figure)) is not None
    ]
    centre = [pair for pair in measured if pair[0].radius_rel <= CENTRE_RADIUS_REL]
    others = [pair for pair in measured if pair[0].radius_rel > CENTRE_RADIUS_REL]
    corners = [pair for pair in others if pair[0].radius_rel >= CORNER_RADIUS_REL]
    if not centre or not others:
        return None
    middle = _average([coefficient.quantity for _, coefficient in centre])
    corner_falloff = dof = None
    if corners:
        ratio = _divide(_average([coefficient.quantity for _, coefficient in corners]), middle)
        corner_falloff = Quantity(
            value=1.0 - ratio.value, standard_uncertainty=ratio.standard_uncertainty, unit="1"
        )
        dof = _find_dof(centre, corners)
    return FalloffTable(
        kind=positions[0].kind,
        channel=positions[0].channel,
        f_number=positions[0].f_number,
        figure=figure,
        centre=tuple(each.position for each, _ in centre),
        corners=tuple(each.position for each, _ in corners),
        rows=tuple(
            Falloff(
                position=each.position,
                radius_rel=each.radius_rel,
                ratio=_divide(coefficient.quantity, middle),
            )
            for each, coefficient in others
        ),
        corner_falloff=corner_falloff,
        corner_falloff_dof=dof,
    )


def _find_dof(*groups: Sequence[tuple[PositionFit, Coefficient]]) -> float:
    """Compute the effective degrees of freedom of a ratio of means (Welch and Satterthwaite)."""
    variance = restless = 0.0
    for group in groups:
        total = math.fsum(each.quantity.value for _, each in group)
        for _, each in group:
            part = (each.quantity.standard_uncertainty / total) ** 2
            variance += part
            restless += part**2 / (each.effective_dof or MOST_DOF)
    return min(MOST_DOF, variance**2 / restless) if restless else MOST_DOF


def _average(quantities: Sequence[Quantity]) -> Quantity:
    count = len(quantities)
    return Quantity(
        value=math.fsum(each.value for each in quantities) / count,
        standard_uncertainty=math.sqrt(math.fsum(each.standard_uncertainty**2 for each in quantities))
        / count,
        unit=quantities[0].unit,
    )


def _divide(upper: Quantity, lower: Quantity) -> Quantity:
    ratio = upper.value / lower.value
    u_rel = math.hypot(upper.standard_uncertainty / upper.value, lower.standard_uncertainty / lower.value)
    return Quantity(value=ratio, standard_uncertainty=ratio * u_rel, unit="1")
