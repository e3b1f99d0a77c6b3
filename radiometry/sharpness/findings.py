"""Flags of fitted positions."""

from collections.abc import Sequence

from radiometry.findings import Raised, shared
from radiometry.sharpness import codes
from radiometry.sharpness.candidates import Candidate
from radiometry.sharpness.falloff import CENTRE_RADIUS_REL
from radiometry.sharpness.results import EdgeColour, FalloffTable, PositionFit
from radiometry.sharpness.rows import Params

LARGEST_OVERSHOOT = 0.05
LARGEST_DEPARTURE_PX = 0.25
SCATTER_RATIO = 4.0
LARGEST_COLOUR_PX = 1.0
_OVERSHOOT_ERRORS = 3.0


def name_position(position: PositionFit) -> str:
    """Return the place to which a flag applies.

    Returns
    -------
    str
        Place, in words.
    """
    return f"position {position.position}" if position.position else ""


def check_positions(positions: Sequence[PositionFit]) -> list[Raised]:
    """Check the results.

    Parameters
    ----------
    positions : sequence of PositionFit
        Results of all positions.

    Returns
    -------
    list of Raised
        Flags: sharpness_once, sharpening_suspected, edge_curved,
        sharpness_beyond_curve.
    """
    raised: list[Raised] = []
    for each in positions:
        where = name_position(each)
        if each.frames == 1:
            raised.append(codes.SHARPNESS_ONCE.at(where, f"Channel {each.channel}: one frame."))
        halo = each.find("overshoot")
        if halo is not None:
            sure = halo.quantity.value - _OVERSHOOT_ERRORS * halo.quantity.standard_uncertainty
            if sure > LARGEST_OVERSHOOT:
                detail = f"Channel {each.channel}: {halo.quantity.value:.1%} of the step."
                raised.append(codes.SHARPENING_SUSPECTED.at(where, detail))
        if each.departure_px is not None and each.departure_px > LARGEST_DEPARTURE_PX:
            detail = f"Channel {each.channel}: {each.departure_px:.2f} px off a straight line."
            raised.append(codes.EDGE_CURVED.at(where, detail))
        main = "mtf50_cycles_per_pixel" if each.cycles is None else "resolving_power_cycles_per_pixel"
        if each.find(main) is None:
            detail = f"Channel {each.channel}: the response stays above the level."
            raised.append(codes.SHARPNESS_BEYOND_CURVE.at(where, detail))
    return raised


def check_candidates(candidates: Sequence[Candidate], params: Params) -> list[Raised]:
    """Check the responses that a fit was given.

    Parameters
    ----------
    candidates : sequence of Candidate
        Responses of all frames.
    params : Params
        Parameters of the fit.

    Returns
    -------
    list of Raised
        Flags: rendered, region_left_out, sharpness_repeats_differ.
    """
    raised: list[Raised] = []
    rendered = sorted({each.frame for each in candidates if each.features.rendered and not each.left_out})
    if rendered:
        raised.append(shared.RENDERED.at("", f"Rendered frames: {len(rendered)}."))
    for each in candidates:
        if each.response is None:
            detail = f"Region {each.region.name}, channel {each.channel}: {each.left_out}"
            raised.append(codes.REGION_LEFT_OUT.at(f"frame {each.frame}", detail))
    for key in sorted({each.key for each in candidates if not each.left_out}):
        raised += _check_repeats(
            [each for each in candidates if each.key == key and not each.left_out], params
        )
    return raised


def _check_repeats(repeats: Sequence[Candidate], params: Params) -> list[Raised]:
    """Compare the range of repeats with what their own uncertainties allow."""
    found = [estimate for each in repeats if (estimate := each.measure(params)) is not None]
    if len(found) < 2:
        return []
    values = [each.value for each in found]
    u = max(each.standard_uncertainty for each in found)
    mean = sum(values) / len(values)
    scatter = (sum((value - mean) ** 2 for value in values) / (len(values) - 1)) ** 0.5
    if scatter <= SCATTER_RATIO * u or scatter <= 0.02 * mean:
        return []
    detail = f"Channel {repeats[0].channel}: from {min(values):.3f} to {max(values):.3f} cycles per pixel."
    name = repeats[0].region.name
    return [codes.SHARPNESS_REPEATS_DIFFER.at(f"position {name}" if name else "", detail)]


def check_falloff(positions: Sequence[PositionFit], tables: Sequence[FalloffTable]) -> list[Raised]:
    """Check whether there are several positions and no middle to compare with.

    Parameters
    ----------
    positions : sequence of PositionFit
        Results of all positions.
    tables : sequence of FalloffTable
        Falloff by channel and f-number.
    """
    if tables or len({each.position for each in positions}) < 2:
        return []
    detail = f"No position lies within {CENTRE_RADIUS_REL:g} of the half diagonal."
    return [codes.SHARPNESS_CENTRE_MISSING.at("", detail)]


def check_colours(colours: Sequence[EdgeColour]) -> list[Raised]:
    """Check how far red and blue lie from green.

    Parameters
    ----------
    colours : sequence of EdgeColour
        Displacements at all positions.

    Returns
    -------
    list of Raised
        Flags: lateral_colour_large.
    """
    return [
        shared.LATERAL_COLOUR_LARGE.at(
            f"position {each.position}" if each.position else "",
            f"{each.channels} is {each.shift.value:+.2f} px along the edge's normal, {each.radius_px:.0f} px "
            f"from the middle of the frame (u {each.shift.standard_uncertainty:.2f} px).",
        )
        for each in colours
        if abs(each.shift.value) - 2.0 * each.shift.standard_uncertainty > LARGEST_COLOUR_PX
    ]
