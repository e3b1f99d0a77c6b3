"""Plot of a sharpness calibration: response by position, per channel; then its coefficient by radius."""

from collections.abc import Iterator
from typing import Any

from radiometry.drawing.sheet import Axis, bar, dot, finish, line, name_series, place, swath

Node = dict[str, Any]

_NYQUIST = 0.5
_FIGURES = ("mtf50_cycles_per_pixel", "resolving_power_cycles_per_pixel")


def draw(result: Node) -> str:
    """Return the SVG of a stored sharpness result; swaths and bars are twice the standard uncertainty."""
    if result.get("blooming"):
        return _draw_blooming(result["blooming"])
    channels = list(dict.fromkeys(each["channel"] for each in result["positions"]))
    parts: list[str] = []
    for index, channel in enumerate(channels):
        mine = [each for each in result["positions"] if each["channel"] == channel]
        parts += _draw_curves(mine, channel, index)
    parts += _draw_radii(result["positions"], channels, len(channels))
    return finish(parts, panels=len(channels) + 1, label="Sharpness calibration")


def _draw_curves(positions: list[Node], channel: str, index: int) -> Iterator[str]:
    """The response of all directions together; the half and Nyquist's frequency are dashed."""
    panel = place(
        index,
        x=Axis(values=[0.0, 1.0], label="cycles per pixel"),
        y=Axis(values=[0.0, 1.0], label="response"),
        title=f"Channel {channel}",
    )
    yield from panel.frame()
    yield panel.line([(_NYQUIST, panel.y.low), (_NYQUIST, panel.y.high)], "limit")
    yield panel.line([(panel.x.low, 0.5), (panel.x.high, 0.5)], "limit")
    for series, each in enumerate(positions):
        curve = each["curves"][0]
        points = list(zip(curve["frequency"], curve["response"], curve["response_u"], strict=True))
        yield swath(panel, [(f, r - 2 * u, r + 2 * u) for f, r, u in points], series)
        yield panel.line([(f, r) for f, r, _ in points], line(series))
    yield from name_series(panel, [name_position(each) for each in positions])


def _draw_radii(positions: list[Node], channels: list[str], index: int) -> Iterator[str]:
    figured = [(each, found) for each in positions if (found := find_figure(each)) is not None]
    name = figured[0][1]["name"] if figured else _FIGURES[0]
    panel = place(
        index,
        x=Axis(values=[0.0, 1.0], label="distance from the middle, 1 at the corners"),
        y=Axis(
            values=[found["quantity"]["value"] for _, found in figured],
            include=(0.0,),
            label="cycles per pixel",
        ),
        title=name.removesuffix("_cycles_per_pixel").replace("_", " "),
    )
    yield from panel.frame()
    for each, found in figured:
        series, told = channels.index(each["channel"]), found["quantity"]
        value, u = told["value"], 2.0 * told["standard_uncertainty"]
        yield bar(panel, each["radius_rel"], value - u, value + u, series)
        yield panel.dot(each["radius_rel"], value, dot(series), f"{name_position(each)}, {each['channel']}")
    yield from name_series(panel, channels)


def find_figure(position: Node) -> Node | None:
    """Return the coefficient that a position is looked up for, None if it has none.

    Parameters
    ----------
    position : Node
        Stored position.
    """
    named = {coefficient["name"]: coefficient for coefficient in position["coefficients"]}
    return next((named[name] for name in _FIGURES if name in named), None)


def name_position(position: Node) -> str:
    """Return the name of a position, with its f-number.

    Parameters
    ----------
    position : Node
        Stored position.
    """
    f_number = position.get("f_number")
    name = str(position["position"] or position["kind"])
    return f"{name}, f/{f_number:g}" if f_number else name


def _draw_blooming(rows: list[Node]) -> str:
    """Return what is added against the distance, one panel per direction."""
    directions = list(dict.fromkeys(each["direction"] for each in rows))
    parts: list[str] = []
    for index, direction in enumerate(directions):
        mine = [each for each in rows if each["direction"] == direction]
        points = [point for each in mine for point in each["added"]]
        panel = place(
            index,
            x=Axis(values=[p["distance_px"] for p in points], include=(0.0,), label="distance [px]"),
            y=Axis(values=[p["added_rel"] for p in points], include=(0.0,), label="added, of saturation"),
            title=f"Blooming {direction}",
        )
        parts += panel.frame()
        for series, each in enumerate(mine):
            for p in each["added"]:
                value, u = p["added_rel"], 2.0 * p["standard_uncertainty_rel"]
                parts += [bar(panel, p["distance_px"], value - u, value + u, series)]
            parts += [panel.line([(p["distance_px"], p["added_rel"]) for p in each["added"]], line(series))]
        parts += name_series(panel, [f"{each['channel']}, {each['exposure_time_s']:g} s" for each in mine])
    return finish(parts, panels=len(directions), label="Blooming of a saturated spot")
