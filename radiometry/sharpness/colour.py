"""Lateral colour from slanted edges: how far red and blue lie from green, along the edge's normal."""

import itertools
import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from radiometry.fitting.evidence import MOST_DOF, Quantity
from radiometry.sharpness.candidates import Candidate
from radiometry.sharpness.features import EdgeResponse, Estimate
from radiometry.sharpness.merging import merge_estimates
from radiometry.sharpness.results import EdgeColour

LATERAL_COLOUR: Final = "lateral_colour_px"
_REFERENCE: Final = "G"
_COLOURS: Final = ("R", "B")
_LEAST_COSINE: Final = 0.5
_LEAST_RADIUS_REL: Final = 0.1


def measure_colours(candidates: Sequence[Candidate]) -> tuple[EdgeColour, ...]:
    """Compare the places of every position's edge in red and blue with that in green.

    Parameters
    ----------
    candidates : sequence of Candidate
        Responses that count.

    Returns
    -------
    tuple of EdgeColour
        Results by position, f-number and pair of channels.

    Notes
    -----
    With p the mean place of the edge along its normal n, over the same lines in every colour, and r the
    vector from the middle of the frame::

        shift = (p_colour - p_G) sign(n r),   radial = shift |r| / |n r|

    A displacement that all positions share, such as a tilted window before the sensor makes, is in both. u of
    one frame is that of the mean of the polynomials through the centroids of the lines, of repeats as for the
    other coefficients.
    """
    shown = [each for each in candidates if isinstance(each.response, EdgeResponse) and each.response.place]
    found = []
    for (position, f_number), group in itertools.groupby(
        sorted(shown, key=lambda each: (each.region.name, each.f_number or 0.0, each.frame)),
        key=lambda each: (each.region.name, each.f_number or 0.0),
    ):
        mine = {(each.frame, each.channel): each for each in group}
        for colour in _COLOURS:
            pairs = [
                (each, mine[frame, _REFERENCE])
                for (frame, channel), each in mine.items()
                if channel == colour and (frame, _REFERENCE) in mine
            ]
            if pairs:
                found.append(_compare(pairs, f"{colour}-{_REFERENCE}", position, f_number or None))
    return tuple(found)


def _compare(
    pairs: Sequence[tuple[Candidate, Candidate]], channels: str, position: str, f_number: float | None
) -> EdgeColour:
    features, region = pairs[0][1].features, pairs[0][1].region
    half = np.array([features.height_px - 1.0, features.width_px - 1.0]) / 2.0
    away = np.array([region.row_px, region.col_px]) - half
    shifts, along, dof = [], [], MOST_DOF
    for one, other in pairs:
        assert isinstance(one.response, EdgeResponse)  # noqa: S101  narrows the type
        assert isinstance(other.response, EdgeResponse)  # noqa: S101
        first, second = one.response.place, other.response.place
        assert first is not None  # noqa: S101
        assert second is not None  # noqa: S101
        towards = float(np.array(second.normal) @ away)
        shifts.append(
            Estimate(
                value=math.copysign(1.0, towards) * (first.place_px - second.place_px),
                standard_uncertainty=math.hypot(first.place_u_px, second.place_u_px),
            )
        )
        along.append(abs(towards))
        dof = min(dof, first.dof, second.dof)
    value, u, _, freedom = merge_estimates(shifts, dof=dof)
    radius = float(np.hypot(*away))
    cosine = float(np.mean(along)) / radius if radius else 0.0
    near = radius < _LEAST_RADIUS_REL * float(np.hypot(*half))
    return EdgeColour(
        channels=channels,
        position=position,
        f_number=f_number,
        radius_px=radius,
        radius_rel=radius / float(np.hypot(*half)),
        shift=Quantity(value=value, standard_uncertainty=u, unit="px"),
        radial=None
        if near or cosine < _LEAST_COSINE
        else Quantity(value=value / cosine, standard_uncertainty=u / cosine, unit="px"),
        frames=len(pairs),
        effective_dof=min(freedom, MOST_DOF),
    )
