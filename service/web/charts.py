"""Charts of the pages as SVG, each point with what static/plots.js shows of it in a card."""

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from html import escape
from typing import Annotated, Any, Final, Literal

import numpy as np
from fastapi import Query, Response

from radiometry.drawing.svg import Panel, Scale, document, span
from radiometry.fitting import models
from radiometry.fleet.determinations import Determination, Key
from service.certificate.figures import in_print, in_step

Axes = Literal["linear", "log"]
Row = dict[str, Any]
Share = Annotated[float, Query(ge=-1, le=2)]

_X: Final = "X = t S L / f²  [cd·s/m²]"
_ALONG: Final = 80
_LEFT_PX, _RIGHT_PX, _TOP_PX, _BOTTOM_PX, _LINE_PX = 66, 14, 14, 48, 22
_MONTHS: Final = (1, 2, 3, 6, 12, 24, 60, 120, 240)
_DAY_S: Final = 86_400.0
_ROOM: Final = 1.15
# around a point: circle, square, triangle, diamond, triangle upside down, cross
_SYMBOLS: Final = (
    *("M-4.5 0a4.5 4.5 0 1 0 9 0a4.5 4.5 0 1 0-9 0Z", "M-4-4H4V4H-4Z", "M0-5L5 4H-5Z"),
    *("M0-5.5L5 0L0 5.5L-5 0Z", "M0 5L5-4H-5Z", "M-5-2H-2V-5H2V-2H5V2H2V5H-2V2H-5Z"),
)
_COLOURS: Final = ("#0b5f6b", "#c1611a", "#6a4c93", "#4f7a28", "#a83f6f", "#3b6fb6")
# of a picture that is saved; in a page stilb.css has the colours
_STYLE: Final = ".line{fill:none}.band{fill:#0b5f6b;opacity:.07}.out{fill:#fff}" + "".join(
    f".s{n}{{stroke:{colour};stroke-width:1.5}}.point.s{n}:not(.out){{fill:{colour}}}"
    for n, colour in enumerate(_COLOURS)
)


@dataclass(frozen=True, kw_only=True)
class View:
    """How wide a chart's place is, and what is shown: shares of either axis of the whole."""

    width: Annotated[int, Query(ge=240, le=2000)] = 900
    x0: Share = 0.0
    x1: Share = 1.0
    y0: Share = 0.0
    y1: Share = 1.0

    def panel(self, x: Scale, y: Scale, labels: tuple[str, str]) -> Panel:
        x, y = x.part(self.x0, self.x1), y.part(self.y0, self.y1)
        return Panel(x=x, y=y, title="", x_label=labels[0], y_label=labels[1])

    def scale_x(
        self, low: float, high: float, *, logarithmic: bool = False, kind: type[Scale] = Scale
    ) -> Scale:
        end = self.width - _RIGHT_PX
        return kind(low=low, high=high, start_px=_LEFT_PX, end_px=end, logarithmic=logarithmic)


class Dates(Scale):
    """Time in seconds since 1970, with a tick at the beginnings of months."""

    def ticks(self) -> list[float]:
        first, last = (datetime.fromtimestamp(at, UTC) for at in (self.low, self.high))
        months = range(12 * first.year + first.month - 1, 12 * last.year + last.month)
        step = next((step for step in _MONTHS if len(months) <= 7 * step), _MONTHS[-1])
        starts = (datetime(n // 12, n % 12 + 1, 1, tzinfo=UTC).timestamp() for n in months if n % step == 0)
        found = [start for start in starts if self.low <= start <= self.high]
        return found or [self.low]

    def label(self, tick: float) -> str:
        return datetime.fromtimestamp(tick, UTC).strftime("%Y-%m")


def draw_signal(result: Row, *, axes: Axes = "linear", view: View = View()) -> str:
    """Signal above dark against X with the fitted models, a colour and a symbol for each ISO value."""
    logarithmic = axes == "log"
    series = [
        (coefficient, [p for p in points if not logarithmic or p["adjusted_signal_dn"] > 0.0])
        for coefficient, points in _by_iso(result)
    ]
    shown = [p for _, points in series for p in points]
    include = () if logarithmic else (0.0,)
    low, high = span([p["rhs"] for p in shown], logarithmic=logarithmic, include=include)
    signals = span([p["adjusted_signal_dn"] for p in shown], logarithmic=logarithmic, include=include)
    told = ", logarithmic" if logarithmic else ""
    panel = view.panel(
        view.scale_x(low, high, logarithmic=logarithmic),
        _scale_y(*signals, 400, logarithmic=logarithmic),
        (f"{_X}{told}", f"signal above dark [DN]{told}"),
    )
    parts: list[str] = []
    for place, (coefficient, points) in enumerate(series):
        parts.append(panel.line(_curve(coefficient, points, panel.x), f"line {_colour(place)}"))
        parts += (_point(panel, p, p["adjusted_signal_dn"], place) for p in points)
    return _finish(panel, parts, _name(series), "Signal against X", view)


def draw_residuals(result: Row, *, view: View = View()) -> str:
    """(L_fit - L_meter) / L_meter in % against X, with the band that the tolerance leaves."""
    limit = 100.0 * result["tolerance_rel"]
    series = [(c, [p for p in points if p["residual_rel"] is not None]) for c, points in _by_iso(result)]
    # a point that was left out may lie anywhere: those that were used fill the plot
    used = [abs(100.0 * p["residual_rel"]) for _, points in series for p in points if p["used"]]
    widest = 1.2 * max([limit, *used])
    low, high = span([p["rhs"] for _, points in series for p in points], logarithmic=True)
    panel = view.panel(
        view.scale_x(low, high, logarithmic=True),
        _scale_y(-widest, widest, 300),
        (f"{_X}, logarithmic", "residual [% of L]"),
    )
    x, y = panel.x, panel.y
    top, bottom = (y(min(max(level, y.low), y.high)) for level in (limit, -limit))
    size = f'width="{x.end_px - x.start_px:.1f}" height="{bottom - top:.1f}"'
    parts = [f'<rect class="band" x="{x.start_px:.1f}" y="{top:.1f}" {size}/>']
    parts += (panel.line([(x.low, level), (x.high, level)], "limit") for level in (limit, 0.0, -limit))
    for place, (_, points) in enumerate(series):
        parts += (_point(panel, p, 100.0 * p["residual_rel"], place) for p in points)
    return _finish(panel, parts, _name(series), "Residuals", view)


def draw_drift(
    found: Sequence[Determination], versions: Mapping[str, int], *, quantity: str, view: View = View()
) -> str:
    """Each ISO, f-number, band and channel in a colour and a symbol; bars are one standard uncertainty.

    ``found`` : of one coefficient, named ``quantity``; ``versions`` : the number of each version
    """
    shared = _shared([row.key for row in found])
    rows: dict[str, list[Determination]] = defaultdict(list)
    for row in found:
        rows[_where(row.key, without=shared).replace("channel ", "")].append(row)
    times = [row.source.at.timestamp() for row in found]
    # at least months, as nothing drifts in hours
    middle, half = (
        (max(times) + min(times)) / 2.0,
        _ROOM * max((max(times) - min(times)) / 2.0, 45.0 * _DAY_S),
    )
    ends = span([row.value + sign * row.standard_uncertainty for row in found for sign in (-1, 1)])
    panel = view.panel(
        view.scale_x(middle - half, middle + half, kind=Dates),
        _scale_y(*ends, 320),
        ("determined", f"{quantity} [{in_print(found[0].key.unit)}]"),
    )
    # error bars of one day would hide one another: together a small share of what is shown
    step = min(0.012, 0.15 / len(rows)) * (panel.x.high - panel.x.low)
    parts: list[str] = []
    for place, series in enumerate(rows.values()):
        shift = (place - (len(rows) - 1) / 2) * step
        ats = [row.source.at.timestamp() + shift for row in series]
        line = list(zip(ats, (row.value for row in series), strict=True))
        parts.append(panel.line(line, f"line faint {_colour(place)}"))
        for at, row in zip(ats, series, strict=True):
            low, high = (row.value + sign * row.standard_uncertainty for sign in (-1, 1))
            low, high = max(low, panel.y.low), min(high, panel.y.high)
            if low <= high:
                parts.append(panel.line([(at, low), (at, high)], f"line {_colour(place)}"))
            value, uncertainty = in_step(row.value, row.standard_uncertainty)
            where = _where(row.key)
            told = (
                f"version {versions[row.source.version]}" + (f", {where}" if where else ""),
                f"{value} ± {uncertainty} {in_print(row.key.unit)}",
                row.source.at.strftime("%Y-%m-%d"),
            )
            parts.append(_draw_symbol(panel, at, row.value, place, told=told))
    return _finish(panel, parts, list(rows) if len(rows) > 1 else [], quantity, view)


def send_svg(drawn: str) -> Response:
    return Response(drawn, media_type="image/svg+xml", headers={"Cache-Control": "private, no-cache"})


def _scale_y(low: float, high: float, height_px: float, *, logarithmic: bool = False) -> Scale:
    return Scale(low=low, high=high, start_px=height_px - _BOTTOM_PX, end_px=_TOP_PX, logarithmic=logarithmic)


def _by_iso(result: Row) -> Iterator[tuple[Row, list[Row]]]:
    for fit in result["iso_fits"]:
        coefficient = fit["coefficient"]
        yield coefficient, [p for p in result["points"] if p["iso"] == coefficient["iso"] and p["rhs"]]


def _name(series: Iterable[tuple[Row, list[Row]]]) -> list[str]:
    return [f"ISO {coefficient['iso']:g}" for coefficient, _ in series]


def _curve(coefficient: Row, points: Sequence[Row], x: Scale) -> list[tuple[float, float]]:
    """The model where there are points, as far as it is shown."""
    if not points:
        return []
    rhs = [p["rhs"] for p in points]
    # a power or a logarithm has no value at 0
    low, high = min(rhs) / (1.0 if x.logarithmic else 50.0), max(rhs)
    low, high = max(low, x.low), min(high, x.high)
    if low >= high:
        return []
    along = np.geomspace(low, high, _ALONG) if x.logarithmic else np.linspace(low, high, _ALONG)
    signal = models.predict(coefficient["model"], np.asarray(coefficient["parameters"]), along)
    kept = signal > 0.0 if x.logarithmic else np.isfinite(signal)
    return list(zip(along[kept].tolist(), signal[kept].tolist(), strict=True))


def _point(panel: Panel, point: Row, value: float, place: int) -> str:
    time_s = point["exposure_time_s"]
    time = f"1/{1.0 / time_s:.4g}" if time_s < 0.3 else f"{time_s:g}"
    told = (
        f"{point['scene']}, {time} s, f/{point['f_number']:g}, ISO {point['iso']:g}",
        f"signal {point['adjusted_signal_dn']:.5g} DN, L {point['luminance_cd_m2']:.4g} cd/m²",
        f"residual {100.0 * point['residual_rel']:+.2f} % of L"
        if point["used"]
        else f"left out: {point['left_out']}",
    )
    frame = {"frame": point["frame"], "frame-id": point["frame_id"]}
    return _draw_symbol(panel, point["rhs"], value, place, told=told, hollow=not point["used"], **frame)


def _draw_symbol(
    panel: Panel, x: float, y: float, place: int, *, told: Sequence[str], hollow: bool = False, **data: str
) -> str:
    """A point with what its card says, or nothing outside the panel."""
    if not (panel.x.low <= x <= panel.x.high and panel.y.low <= y <= panel.y.high):
        return ""
    # a line feed as it is would be read as a space
    said = {name: escape(text) for name, text in data.items()} | {"told": "&#10;".join(map(escape, told))}
    more = "".join(f' data-{name}="{text}"' for name, text in said.items())
    return (
        f'<path class="point {"out " if hollow else ""}{_colour(place)}"{more} '
        f'transform="translate({panel.x(x):.1f} {panel.y(y):.1f})" d="{_symbol(place)}"/>'
    )


def _finish(panel: Panel, parts: Iterable[str], names: Sequence[str], label: str, view: View) -> str:
    """With the axes behind and the legend below, in as many columns as there is room for."""
    inner = panel.x.end_px - panel.x.start_px
    columns = max(1, int(inner // (32 + 7 * max(map(len, names), default=1))))
    top = panel.y.start_px + _BOTTOM_PX
    legend: list[str] = []
    for place, name in enumerate(names):
        x = panel.x.start_px + place % columns * inner / columns + 8
        y = top + _LINE_PX * (place // columns) + 8
        at = f'transform="translate({x:.1f} {y:.1f})"'
        symbol = f'<path class="point {_colour(place)}" {at} d="{_symbol(place)}"/>'
        text = f'<text x="{x + 12:.1f}" y="{y + 4:.1f}">{escape(name)}</text>'
        legend.append(f'<g class="legend" data-series="{place}">{symbol}{text}</g>')
    height = math.ceil(top + _LINE_PX * -(-len(names) // columns))
    drawn = [*panel.frame(), *parts, *legend]
    return document(drawn, width_px=view.width, height_px=height, label=label, style=_STYLE)


def _colour(place: int) -> str:
    return f"s{place % len(_COLOURS)}"


def _symbol(place: int) -> str:
    return _SYMBOLS[place % len(_SYMBOLS)]


def _where(key: Key, *, without: frozenset[str] = frozenset()) -> str:
    """Return what a series holds for, but for what goes without saying."""
    return ", ".join(part for part in _parts(key) if part not in without)


def _parts(key: Key) -> list[str]:
    said = str(key).removeprefix(key.name).removeprefix(" at ").split(", ")
    # of sharpness the model ends with the place in the frame
    return [part for part in (*said, key.model.partition(":")[2]) if part]


def _shared(keys: Sequence[Key]) -> frozenset[str]:
    """Return what all series hold for: nothing for a single one, as it must have a name."""
    if len(set(keys)) == 1:
        return frozenset()
    return frozenset.intersection(*(frozenset(_parts(key)) for key in keys))
