"""Target, features, parameters and results, ready for JSON, and their plots; what does not exist is None."""

import math
from collections.abc import Iterator
from typing import Any, Final, Literal, get_args

from radiometry.drawing.figure import MOST, Axis, Figure, Mark, Plot, Series
from radiometry.drawing.text import write_quantity
from radiometry.findings import Raised
from radiometry.fitting.evidence import Exclusion, FrameEvidence, Quantity
from radiometry.records import Record, about, later
from radiometry.specification.certificate import KeyFigure, choose_channel, of_quantity
from radiometry.specification.parameters import check_parameters, parameter

# Of every stored response, which runs from 0 to 1 cycles per pixel: one grid for all edges of all frames
CURVE_STEP_CYCLES_PER_PIXEL = 0.01


class Estimate(Record):
    """A number and its standard uncertainty."""

    value: float
    standard_uncertainty: float


class EdgePlace(Record):
    """Place of an edge in one channel."""

    normal: tuple[float, float]  # Unit normal (row, col), to the right or downwards
    # Mean place along the normal from the middle of the region, and its standard uncertainty [px]
    place_px: float
    place_u_px: float
    dof: float  # Degrees of freedom of the latter


class EdgeResponse(Record):
    """Response of one channel at one edge; lengths are in pixels of the whole sensor, normal to the edge."""

    channel: str
    orientation: str  # "vertical": the edge crosses the rows; "horizontal": it crosses the columns
    angle_deg: float  # Angle between the edge and the columns (vertical) or rows (horizontal), unsigned [deg]
    lines: int  # Lines of the channel that count, and how often the edge passes a whole pixel in them
    periods: float
    departure_px: float  # Largest distance of the edge from a straight line [px]
    contrast: float  # (bright - dark) / (bright + dark)
    noise_rel: float  # Noise of a pixel, as a fraction of the step
    mtf: tuple[float, ...]  # MTF and its standard uncertainty at 0, 0.01, ..., 1 cycles per pixel
    mtf_u: tuple[float, ...]
    mtf50: Estimate | None  # Frequency at which the MTF is 0.5 [cycles per pixel]; None where it is above 1
    mtf_nyquist: Estimate | None  # MTF at the Nyquist frequency
    rise_px: Estimate | None  # 10-90 % rise [px]
    lsf_fwhm_px: Estimate | None  # Full width at half maximum of the line spread function [px]
    overshoot: Estimate | None  # Excess beyond the bright and the dark side, as a fraction of the step
    undershoot: Estimate | None
    # Place of the edge; None in features from before it was measured
    place: EdgePlace | None = later()


class Contrasts(Record):
    """Contrast of a star by frequency, 1 far outside."""

    # Direction of the sector's middle, from x (right) towards y (down) [deg]; None for all directions
    # together. Its spokes run that way, so the response is the one across it.
    direction_deg: float | None
    contrast: tuple[float, ...]  # Contrast and its standard uncertainty
    contrast_u: tuple[float, ...]


class StarResponse(Record):
    """Response of one channel at one star."""

    channel: str
    cycles: int  # Cycles of the star
    centre_row_px: float  # Centre, as pixel indices, the first pixel's centre being 0
    centre_col_px: float
    outer_radius_px: float  # Radius of the largest ring [px]
    modulation: float  # (bright - dark) / (bright + dark) of the fundamental far outside
    # Rising frequencies [cycles per pixel], one for each contrast of every curve
    frequency: tuple[float, ...]
    whole: Contrasts  # Contrast of all directions together
    sectors: tuple[Contrasts, ...]  # Contrast of each sector


class Refusal(Record):
    """Reason why a channel of a region has no response: code and sentence of the error."""

    channel: str
    code: str
    message: str


class RegionResponse(Record):
    """One region: edges or stars by channel, and channels without a response."""

    name: str  # Name of the region
    row_px: float  # Middle of the region [px]
    col_px: float
    edges: tuple[EdgeResponse, ...]  # Responses by channel
    stars: tuple[StarResponse, ...]
    refused: tuple[Refusal, ...]  # Channels without a response


class Features(Record):
    """Responses of all regions of a frame."""

    kind: str  # Kind of the target
    height_px: int
    width_px: int
    rendered: bool  # True if the frame is rendered
    regions: tuple[RegionResponse, ...]


Kind = Literal["slanted_edge", "siemens_star"]
ToneCurve = Literal["linear", "srgb", "gamma"]
FrameRow = FrameEvidence[Features]

_EDGE_ORDERS = (1, 5)
_CYCLES = (4, 1000)
_GAMMAS = (0.2, 5.0)


class StarCentre(Record):
    """Centre of a star: x right, y down [px], as regions are drawn; `region` names the star."""

    region: str
    x_px: float
    y_px: float


class Target(Record):
    """Photographed target; every region of a frame shows one edge or one star."""

    kind: Kind = about("Kind of the target.", default="slanted_edge")
    edge_order: int = about(
        "Order of the polynomial through the edge, 1 (straight) to 5 (ISO 12233:2023).", default=5
    )
    cycles: int = about(
        "Cycles of a star: pairs of a dark and a bright sector, 48 for 96 sectors.", default=48
    )
    centres: tuple[StarCentre, ...] = about(
        "Centres of stars, where they are known; the others are found.", default=()
    )
    tone_curve: ToneCurve = about(
        'Tone curve to undo in rendered images; raw files are linear and need neither. "linear": as '
        'they are; "srgb": IEC 61966-2-1; "gamma": signal = light ^ (1 / gamma).',
        default="linear",
    )
    gamma: float = about(
        'Tone curve to undo in rendered images; raw files are linear and need neither. "linear": as '
        'they are; "srgb": IEC 61966-2-1; "gamma": signal = light ^ (1 / gamma).',
        default=2.2,
    )

    def __post_init__(self) -> None:
        if self.kind not in get_args(Kind):
            raise ValueError(f"kind must be one of {', '.join(get_args(Kind))}")
        if self.tone_curve not in get_args(ToneCurve):
            raise ValueError(f"tone_curve must be one of {', '.join(get_args(ToneCurve))}")
        for name, value, (low, high) in (
            ("edge_order", self.edge_order, _EDGE_ORDERS),
            ("cycles", self.cycles, _CYCLES),
            ("gamma", self.gamma, _GAMMAS),
        ):
            if not low <= value <= high:
                raise ValueError(f"{name} must lie between {low} and {high}")
        if not all(math.isfinite(each.x_px) and math.isfinite(each.y_px) for each in self.centres):
            raise ValueError("x_px and y_px of centres must be finite numbers")


class Params(Record):
    """Parameters of a sharpness fit."""

    pixel_pitch_um: float | None = parameter(
        None,
        label="Pixel pitch",
        description="Distance of neighbouring pixels; without it nothing is reported in line pairs per "
        "millimetre.",
        unit="um",
        default_text="the camera's, where it is registered",
        example=3.28,
        bounds="[0.1, 100]",
    )
    star_contrast: float = parameter(
        0.1,
        label="Contrast at the limiting resolution",
        description="Contrast at which a star counts as resolved, relative to its contrast far outside.",
        bounds="[0.01, 0.9]",
    )
    exclude: tuple[Exclusion, ...] = ()

    def __post_init__(self) -> None:
        check_parameters(self)


class Coefficient(Record):
    """One coefficient of one position and channel."""

    name: str = about("Name of the coefficient.")
    quantity: Quantity = about("Value with uncertainty.")
    repeatability: float | None = about("Standard deviation of single frames; None for one frame.")
    effective_dof: float | None = about(
        "Effective degrees of freedom of the standard uncertainty, at most 1e6; None in versions from "
        "before they were evaluated.",
        default=None,
    )


class Curve(Record):
    """Response: mean over the frames, with its standard uncertainty."""

    direction_deg: float | None = about("Direction of a star's sector [deg], else None.")
    frequency: tuple[float, ...] = about("Frequencies [cycles per pixel].")
    response: tuple[float, ...] = about("Response and its standard uncertainty.")
    response_u: tuple[float, ...] = about("Response and its standard uncertainty.")


class Direction(Record):
    """The resolving power of a star's sector; None where it is resolved up to the last ring."""

    direction_deg: float
    resolving_power: Quantity | None


class PositionFit(Record):
    """One channel of one position at one f-number."""

    kind: str = about("Kind of the target.")
    position: str
    channel: str
    f_number: float | None
    row_px: float
    col_px: float
    radius_rel: float = about("Distance from the frame's middle, 1 at its corners.")
    frames: int = about("Number of frames.")
    orientation: str | None = about("Orientation, angle [deg] and departure [px] of edges; None for stars.")
    angle_deg: float | None = about("Orientation, angle [deg] and departure [px] of edges; None for stars.")
    departure_px: float | None = about(
        "Orientation, angle [deg] and departure [px] of edges; None for stars."
    )
    cycles: int | None = about("Cycles of stars; None for edges.")
    coefficients: tuple[Coefficient, ...] = about("Coefficients of one version.")
    curves: tuple[Curve, ...] = about("Responses.")
    directions: tuple[Direction, ...] = about("Resolving power of each sector.")

    def find(self, name: str) -> Coefficient | None:
        return next((each for each in self.coefficients if each.name == name), None)


class Falloff(Record):
    """Position compared with the middle of the frame."""

    position: str
    radius_rel: float = about("Distance from the frame's middle, 1 at its corners.")
    ratio: Quantity = about("Ratio to the middle, 1 where it is as sharp.")


class FalloffTable(Record):
    """Decrease of sharpness towards the corners, per channel and f-number."""

    kind: str = about("Kind of the target.")
    channel: str
    f_number: float | None
    figure: str = about("Coefficient that is compared.")
    centre: tuple[str, ...] = about("Positions that make up the middle.")
    corners: tuple[str, ...] = about("Positions that make up the corners.")
    rows: tuple[Falloff, ...] = about("Falloff of each position.")
    corner_falloff: Quantity | None = about(
        "1 - (mean of the corners) / (mean of the middle); None without corners."
    )
    corner_falloff_dof: float | None = about(
        "Its effective degrees of freedom, as of a coefficient.", default=None
    )


class Point(Record):
    """One channel of one region of one frame."""

    frame: str
    position: str
    channel: str
    f_number: float | None
    used: bool = about("True if the fit used it.")
    left_out: str = about('"" for one that was used, else the reason.')
    figure: str = about("Coefficient that is compared, its value and its standard uncertainty.")
    value: float | None = about("Coefficient that is compared, its value and its standard uncertainty.")
    standard_uncertainty: float | None
    residual_rel: float | None = about("Relative difference from the mean of its position.")


class EdgeColour(Record):
    """Displacement of one colour against green at one position; what does not exist is None."""

    channels: str = about('Pair of channels, such as "R-G".')
    position: str
    f_number: float | None
    radius_px: float = about("Distance of the edge from the middle of the frame [px], and 1 at its corners.")
    radius_rel: float = about("Distance of the edge from the middle of the frame [px], and 1 at its corners.")
    shift: Quantity = about(
        "Displacement along the edge's normal, positive away from the middle of the frame."
    )
    radial: Quantity | None = about(
        "Radial displacement of which `shift` is the part along the normal, positive is outwards; None "
        "within a tenth of the half diagonal, and where the normal is more than 60 degrees off the radius."
    )
    frames: int = about("Number of frames.")
    effective_dof: float = about("Effective degrees of freedom of both.")


class Fit(Record):
    """A sharpness calibration."""

    positions: tuple[PositionFit, ...]
    falloff: tuple[FalloffTable, ...]
    points: tuple[Point, ...]
    flags: tuple[Raised, ...]
    lateral_colour: tuple[EdgeColour, ...] | None = later()


_LABELS = {"mtf50_cycles_per_pixel": "MTF50", "resolving_power_cycles_per_pixel": "Resolving power"}


def list_key_figures(result: dict[str, Any]) -> tuple[KeyFigure, ...]:
    """Return the figure of the positions nearest to the middle and farthest from it, at each f-number."""
    positions = sorted(result["positions"], key=lambda each: float(each["radius_rel"]))
    if not positions:
        return ()
    shown = choose_channel(each["channel"] for each in positions)
    figures: list[KeyFigure] = []
    for f_number in dict.fromkeys(each.get("f_number") for each in positions):
        here = [each for each in positions if each["channel"] == shown and each.get("f_number") == f_number]
        for each in here[:1] + here[1:][-1:]:
            group = each["position"] or ("centre" if each is here[0] else "corner")
            group += f", f/{f_number:g}" if f_number else ""
            named = {row["name"]: row for row in each["coefficients"]}
            name = next((name for name in _LABELS if name in named), None)
            if name is not None:
                row, label = named[name], f"{_LABELS[name]}, {shown}"
                figures += of_quantity(group, label, row["quantity"], dof=row.get("effective_dof"))
    return tuple(figures)


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
