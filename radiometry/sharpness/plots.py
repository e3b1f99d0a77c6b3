"""Plots of a sharpness version: response curves, where on the frame they hold, and the figure by radius."""

from collections.abc import Iterator
from typing import Any, Final

from radiometry.drawing.figure import MOST, Axis, Figure, Mark, Plot, Series
from radiometry.drawing.text import write_quantity
from radiometry.specification.certificate import choose_channel

Node = dict[str, Any]

_NYQUIST: Final = 0.5
_FIGURES: Final = ("mtf50_cycles_per_pixel", "resolving_power_cycles_per_pixel")


def _build_curves(result: Node, _: Any) -> Iterator[Figure]:  # noqa: ANN401  no rows are needed
    """Per channel, the response of each position with a mark where it is a half."""
    for channel in _channels(result):
        series = []
        for place, each in _of(result, channel):
            # the first is of all directions together
            points = [
                point
                for curve in each["curves"][:1]
                for point in zip(curve["frequency"], curve["response"], curve["response_u"], strict=True)
            ]
            found, name = _find_figure(each), _name_position(each)
            halves = [found] if found and found["name"].startswith("mtf50") else []
            marks = (
                Mark(x=half["quantity"]["value"], y=0.5, name=name, told=(_tell(half),)) for half in halves
            )
            series.append(
                Series(
                    name=name,
                    model=tuple((f, r) for f, r, _ in points),
                    swath=tuple((f, r - 2.0 * u, r + 2.0 * u) for f, r, u in points),
                    marks=tuple(marks),
                    place=place,
                )
            )
        yield Figure(
            part=channel,
            x=Axis(label="frequency [cycles/px]", include=(0.0, 1.0)),
            y=Axis(label="response", include=(0.0, 1.0)),
            levels=(0.5,),
            uprights=(_NYQUIST,),
            series=tuple(series),
            note="Dashed: a half, and Nyquist's frequency",
        )


def _build_places(result: Node, _: Any) -> Iterator[Figure]:  # noqa: ANN401
    """The positions on the frame, in the colours of their curves."""
    middle = [each for each in result["positions"] if each["radius_rel"] == 0.0]
    ends = [(2.0 * each["col_px"], -2.0 * each["row_px"]) for each in middle[:1]]
    for channel in _channels(result):
        series = []
        for place, each in _of(result, channel):
            found = _find_figure(each)
            told = (_tell(found),) if found else ()
            mark = Mark(x=each["col_px"], y=-each["row_px"], name=_name_position(each), told=told)
            series.append(Series(name=_name_position(each), marks=(mark,), place=place))
        yield Figure(
            part=channel,
            x=Axis(label="column [px]", include=(0.0, *(col for col, _ in ends))),
            y=Axis(label="row [px]", is_downward=True, include=(0.0, *(row for _, row in ends))),
            series=tuple(series),
        )


def _build_radii(result: Node, _: Any) -> Iterator[Figure]:  # noqa: ANN401
    """The figure of each position against its distance from the middle, a series per channel."""
    series = []
    for channel in _channels(result):
        marks = []
        for _place, each in _of(result, channel):
            found = _find_figure(each)
            if found:
                y, u = found["quantity"]["value"], 2.0 * found["quantity"]["standard_uncertainty"]
                mark = Mark(
                    x=each["radius_rel"],
                    y=y,
                    low=y - u,
                    high=y + u,
                    name=f"{_name_position(each)}, {channel}",
                    told=(_tell(found),),
                )
                marks.append(mark)
        series.append(Series(name=channel, marks=tuple(marks)))
    if any(each.marks for each in series):
        yield Figure(
            x=Axis(label="distance from the middle, 1 at the corners", include=(0.0, 1.0)),
            y=Axis(label="cycles/px", include=(0.0,)),
            series=tuple(series),
        )


def _find_figure(position: Node) -> Node | None:
    """Return the coefficient that a position is looked up for, None if it has none."""
    named = {coefficient["name"]: coefficient for coefficient in position["coefficients"]}
    return next((named[name] for name in _FIGURES if name in named), None)


def _name_position(position: Node) -> str:
    f_number = position.get("f_number")
    name = str(position["position"] or position["kind"])
    return f"{name}, f/{f_number:g}" if f_number else name


def _tell(found: Node) -> str:
    quantity = found["quantity"]
    return write_quantity(quantity["value"], quantity["standard_uncertainty"], quantity["unit"])


def _channels(result: Node) -> list[str]:
    """Return the channels, first the one that stands for brightness."""
    channels = list(dict.fromkeys(each["channel"] for each in result["positions"]))
    return sorted(channels, key=lambda name: name != choose_channel(channels))


def _of(result: Node, channel: str) -> list[tuple[int, Node]]:
    """Return the positions of a channel, each with the number of its colour."""
    names = list(dict.fromkeys(_name_position(each) for each in result["positions"]))
    mine = [each for each in result["positions"] if each["channel"] == channel]
    return [(names.index(_name_position(each)), each) for each in mine]


PLOTS: Final = (
    Plot(
        name="response",
        title="MTF by place",
        build=_build_curves,
        note="Bands: two standard uncertainties",
        most_printed=MOST,
    ),
    Plot(name="places", title="Places on the frame", build=_build_places),
    Plot(name="radius", title="MTF50 and distance", build=_build_radii, most_printed=1),
)
