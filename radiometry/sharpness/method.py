"""Sharpness: contrast that a camera keeps by spatial frequency, from slanted edges or Siemens stars.

Computed as in ISO 12233:2023 [1]_ (e-SFR, s-SFR) as implemented by sfrmat5::

    MTF(f) = |F{LSF}(f)| / |F{LSF}(0)|,   LSF = d ESF / dx          f in cycles per pixel of the whole sensor
    RP = n / (pi d)      of a star of n cycles, d the DIAMETER of the disc that is not resolved

The lp/mm of the camera paper's equation 3 are line widths per millimetre of a 24 mm picture, and its d is a
diameter; both are corrected here.

References
----------
.. [1] ISO 12233:2023
"""

import itertools
from collections.abc import Sequence

from radiometry.findings import InputRejected, shared
from radiometry.fitting.evidence import CoefficientValue, Extracted, Region
from radiometry.frame import Frame, FrameHeader
from radiometry.frame.exposure import Exposure
from radiometry.sharpness.candidates import Candidate, collect_candidates, missing
from radiometry.sharpness.colour import LATERAL_COLOUR, measure_colours
from radiometry.sharpness.extraction import extract_features
from radiometry.sharpness.falloff import compare_positions
from radiometry.sharpness.features import Features
from radiometry.sharpness.findings import (
    check_candidates,
    check_colours,
    check_falloff,
    check_positions,
    name_position,
)
from radiometry.sharpness.merging import merge_position
from radiometry.sharpness.results import Fit, Point, PositionFit
from radiometry.sharpness.rows import FrameRow, Params, Target


def extract(
    frame: Frame,
    regions: Sequence[Region],
    *,
    header: FrameHeader,
    exposure: Exposure | None,  # noqa: ARG001 (a chart needs none; the door is one for all methods)
    target: Target,
) -> Extracted[Features]:
    """Measure every region of a frame in every channel.

    Returns
    -------
    Extracted[Features]
        Statistics over all regions together, and the responses of each region.

    Raises
    ------
    InputRejected
        `roi_outside_frame`, `roi_empty`; where no channel of any region can be used,
        the first one's reason: `edge_not_found`, `edge_angle_unsuitable`,
        `edge_too_short`, `edge_too_noisy`, `chart_clipped`, `chart_contrast_too_low`,
        `star_not_found` or `star_too_small`.
    """
    statistics, features = extract_features(frame, regions, header=header, target=target)
    return Extracted(statistics=statistics, features=features)


def fit(rows: Sequence[FrameRow], params: Params) -> Fit:
    """Merge the frames of every position, and compare the positions.

    Raises
    ------
    InputRejected
        `fit_incomplete` if frames are not extracted yet, or no region can be used.

    Notes
    -----
    The same input in any order gives the same result to the last bit.

    Flags per position: lateral_colour_large, sharpness_once, sharpness_repeats_differ,
    sharpening_suspected, edge_curved, sharpness_beyond_curve. Flag per frame: region_left_out. Flags of the
    whole fit: rendered, sharpness_centre_missing.
    """
    lacking = missing(rows, params)
    if lacking:
        raise InputRejected(shared.FIT_INCOMPLETE, f"The fit cannot start: {'; '.join(lacking)}.")
    candidates = collect_candidates(rows, params)
    used = [each for each in candidates if not each.left_out]
    if not used:
        raise InputRejected(shared.FIT_INCOMPLETE, "No edge or star of the chart frames can be used.")
    colours = measure_colours(used)
    positions = tuple(
        merge_position(list(group), params) for _, group in itertools.groupby(used, key=lambda each: each.key)
    )
    falloff = compare_positions(positions)
    return Fit(
        positions=positions,
        falloff=falloff,
        points=tuple(_describe_point(each, positions, params) for each in candidates),
        flags=(
            *check_candidates(candidates, params),
            *check_positions(positions),
            *check_falloff(positions, falloff),
            *check_colours(colours),
        ),
        lateral_colour=colours or None,
    )


def list_coefficients(fitted: Fit) -> tuple[CoefficientValue, ...]:
    """Return every coefficient of every position, then the falloff to the corners.

    Returns
    -------
    tuple of CoefficientValue
        Coefficients. `model` contains the position, "slanted_edge:top-left"; that of
        the falloff is the kind of target alone.
    """
    figures = [
        CoefficientValue(
            name=coefficient.name,
            value=coefficient.quantity.value,
            standard_uncertainty=coefficient.quantity.standard_uncertainty,
            unit=coefficient.quantity.unit,
            model=f"{each.kind}:{each.position}" if each.position else each.kind,
            f_number=each.f_number,
            channel=each.channel,
            flags=_flags_at(fitted, name_position(each)),
            effective_dof=coefficient.effective_dof,
        )
        for each in fitted.positions
        for coefficient in each.coefficients
    ]
    figures += [
        CoefficientValue(
            name=LATERAL_COLOUR,
            value=each.radial.value,
            standard_uncertainty=each.radial.standard_uncertainty,
            unit=each.radial.unit,
            model=f"slanted_edge:{each.position}" if each.position else "slanted_edge",
            f_number=each.f_number,
            channel=each.channels,
            flags=_flags_at(fitted, f"position {each.position}" if each.position else ""),
            effective_dof=each.effective_dof,
        )
        for each in fitted.lateral_colour or ()
        if each.radial is not None
    ]
    figures += [
        CoefficientValue(
            name="corner_falloff",
            value=table.corner_falloff.value,
            standard_uncertainty=table.corner_falloff.standard_uncertainty,
            unit=table.corner_falloff.unit,
            model=table.kind,
            f_number=table.f_number,
            channel=table.channel,
            flags=_flags_at(fitted, ""),
            effective_dof=table.corner_falloff_dof,
        )
        for table in fitted.falloff
        if table.corner_falloff is not None
    ]
    return tuple(figures)


def _flags_at(fitted: Fit, where: str) -> tuple[str, ...]:
    return tuple(sorted({raised.flag for raised in fitted.flags if raised.where in ("", where)}))


def _describe_point(candidate: Candidate, positions: Sequence[PositionFit], params: Params) -> Point:
    """Return one channel of one region with its distance from its position's mean."""
    estimate = candidate.measure(params)
    residual = None
    if estimate is not None and not candidate.left_out:
        at = next(each for each in positions if _key(each) == candidate.key)
        mean = at.find(candidate.figure)
        residual = None if mean is None else estimate.value / mean.quantity.value - 1.0
    return Point(
        frame=candidate.frame,
        position=candidate.region.name,
        channel=candidate.channel,
        f_number=candidate.f_number,
        used=not candidate.left_out,
        left_out=candidate.left_out,
        figure=candidate.figure,
        value=None if estimate is None else estimate.value,
        standard_uncertainty=None if estimate is None else estimate.standard_uncertainty,
        residual_rel=residual,
    )


def _key(position: PositionFit) -> tuple[str, str, str, float]:
    return position.kind, position.position, position.channel, position.f_number or 0.0
