"""Vignetting: fraction V of the light that the lens transmits at every place, per f-number and channel.

The falloff is fitted to flat fields [1]_::

    signal - dark = A V(r)          V(r) = 1 + k1 r^2 + k2 r^4 + k3 r^6

r = 1 at half of the frame's diagonal, from a fitted centre; dividing by V corrects. In place of the
profiles of [1]_, the centre is fitted and falloffs have their errors.

References
----------
.. [1] "Four Vision" report, 3.3.2
"""

from collections import Counter
from collections.abc import Sequence

from radiometry.findings import InputRejected, shared
from radiometry.fitting.evidence import MOST_DOF, CoefficientValue, Extracted, Quantity, Region
from radiometry.frame import Frame, FrameHeader
from radiometry.frame.exposure import Exposure
from radiometry.frame.statistics import CHANNELS
from radiometry.vignetting import codes
from radiometry.vignetting.features import Features, FrameRow, extract_features
from radiometry.vignetting.findings import check_fits, check_frames, find_thresholds
from radiometry.vignetting.fit import FittedChannel, find_best, fit_channel
from radiometry.vignetting.points import (
    Candidate,
    collect_candidates,
    describe_points,
    missing,
    require_one_lens,
)
from radiometry.vignetting.results import (
    EQUATION,
    Coefficient,
    Fit,
)
from radiometry.vignetting.rows import Params
from radiometry.vignetting.solution import Blocks, Solution


def extract(
    frame: Frame, regions: Sequence[Region], *, header: FrameHeader, exposure: Exposure | None
) -> Extracted[Features]:
    """Compute the averages of a flat or dark frame over blocks.

    Raises
    ------
    InputRejected
        `roi_empty` if no block lies entirely in a region.
    """
    del exposure
    return extract_features(frame, regions, header=header)


def fit(rows: Sequence[FrameRow], params: Params) -> Fit:
    """Fit the falloff of every f-number and channel of a campaign's flat frames.

    Raises
    ------
    InputRejected
        `fit_incomplete` if there is no flat frame, or frames are not extracted yet;
        `flat_unusable` if every flat frame is left out, each with its reason, or they
        are of several lenses; `fit_failed` if hardly any light is left in a corner.

    Notes
    -----
    The same input in any order gives the same result to the last bit. All numbers are finite; what does not
    exist is None.

    Flags per frame: flat_left_out, weak_flat, dust. Flags per ISO value: dark_from_black_level,
    dark_exposure_differs, dark_not_dark. Flags per f-number and channel: uneven_light, centre_uncertain,
    light_not_turned, falloff_not_monotonic, falloff_grows, vignetting_misfit. Flag of the whole fit:
    rendered.
    """
    lacking = missing(rows, params)
    if lacking:
        raise InputRejected(shared.FIT_INCOMPLETE, f"The fit cannot start: {'; '.join(lacking)}.")
    candidates = collect_candidates(rows, params)
    used = [candidate for candidate in candidates if not candidate.left_out]
    if not used:
        reasons = "; ".join(f"{each.row.frame}: {each.left_out}" for each in candidates)
        raise InputRejected(codes.FLAT_UNUSABLE, f"No flat frame can be used. {reasons}.")
    require_one_lens(candidates)
    fitted = _fit_all(candidates, params)
    return Fit(
        height_px=fitted[0].fit.coefficient.height_px,
        width_px=fitted[0].fit.coefficient.width_px,
        cfa=next(each.row.features.cfa for each in used if each.row.features is not None),
        channel_fits=tuple(each.fit for each in fitted),
        thresholds=find_thresholds(fitted),
        points=describe_points(rows, candidates, params),
        flags=(*check_frames(candidates, rows, params), *check_fits(fitted)),
    )


def _fit_all(candidates: Sequence[Candidate], params: Params) -> list[FittedChannel]:
    """Fit every f-number and channel, then again with the centre that one f-number determines best."""
    turns = _find_turns(candidates, params)
    groups: dict[tuple[str, float], list[tuple[Blocks, float]]] = {}
    for candidate in candidates:
        if candidate.light is not None and not candidate.left_out:
            for light in candidate.channels:
                group = groups.setdefault((light.channel, candidate.light.f_number), [])
                group.append((light.blocks, turns[candidate.row.frame]))

    def fit_one(key: tuple[str, float], known: Solution | None = None) -> FittedChannel:
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


def list_coefficients(fit: Fit) -> tuple[CoefficientValue, ...]:
    """Return k1, k2, k3, the centre and the corner's falloff, per f-number and channel."""
    return tuple(
        CoefficientValue(
            name=name,
            value=quantity.value,
            standard_uncertainty=quantity.standard_uncertainty,
            unit=quantity.unit,
            model=EQUATION,
            f_number=coefficient.f_number,
            band=None if coefficient.channel in CHANNELS else coefficient.channel,
            channel=coefficient.channel,
            flags=_flags_of(fit, coefficient),
            effective_dof=each.effective_dof.get(name, MOST_DOF) if each.effective_dof else None,
        )
        for each in fit.channel_fits
        for coefficient in (each.coefficient,)
        for name, quantity in _list_quantities(coefficient).items()
    )


def _list_quantities(coefficient: Coefficient) -> dict[str, Quantity]:
    values = {
        "k1": (coefficient.k1, "1"),
        "k2": (coefficient.k2, "1"),
        "k3": (coefficient.k3, "1"),
        "centre_row_px": (coefficient.centre_row_px, "px"),
        "centre_col_px": (coefficient.centre_col_px, "px"),
    }
    quantities = {
        name: Quantity(
            value=value, standard_uncertainty=coefficient.covariance[index][index] ** 0.5, unit=unit
        )
        for index, (name, (value, unit)) in enumerate(values.items())
    }
    quantities["corner_falloff"] = Quantity(
        value=coefficient.corner_falloff,
        standard_uncertainty=coefficient.corner_falloff_standard_uncertainty,
        unit="1",
    )
    return quantities


def _flags_of(fit: Fit, coefficient: Coefficient) -> tuple[str, ...]:
    """Return the flags that concern a coefficient: its own, its frames' and those of the whole fit."""
    f_number = coefficient.f_number
    frames = {f"frame {point.frame}" for point in fit.points if point.f_number == f_number}
    wheres = {"", f"f/{f_number:g} {coefficient.channel}", *frames}
    isos = {raised.flag for raised in fit.flags if raised.where.startswith("iso ")}
    return tuple(sorted({raised.flag for raised in fit.flags if raised.where in wheres} | isos))
