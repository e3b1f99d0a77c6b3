"""Corners in one picture, lateral colour, parameters and results of a fit, ready for JSON; their plots."""

from collections.abc import Iterator, Sequence
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from radiometry.drawing.figure import Axis, Cell, Figure, Mark, Plot, Series
from radiometry.findings import Raised
from radiometry.fitting.evidence import Exclusion, Extracted, FrameEvidence, Quantity, Region
from radiometry.frame import Frame, FrameHeader, roi
from radiometry.frame.opencv import cv2
from radiometry.frame.statistics import compute_statistics
from radiometry.geometry.camera import BINOMIAL, CameraModel, make_grey
from radiometry.geometry.target import FirstSquare, Found, Target, find_corners, refine
from radiometry.records import Record, about, later
from radiometry.specification.certificate import KeyFigure, of_quantity
from radiometry.specification.parameters import check_parameters, parameter

POINTS: Final = 11
FEWEST_VIEWS: Final = 3
_REFERENCE: Final = "G"
_LETTERS: Final = "RGB"
_TERMS: Final = 4

Matrix = NDArray[np.float64]


class ColourCorners(Record):
    """Corners of a board in one colour."""

    channel: str  # Colour, R or B
    moved_px: tuple[tuple[float, float], ...]  # (row, col) of each corner less its place in green [px]


class ColourPoint(Record):
    """Lateral colour at one distance from the principal point; positive is outwards."""

    radius_px: float = about("Distance [px].")
    displacement_px: float = about("Radial displacement [px].")
    standard_uncertainty_px: float
    extrapolated: bool = about("True if further out than any corner that was used.")


class LateralColour(Record):
    """Lateral colour of one colour against green."""

    channels: str = about('Pair of channels, such as "R-G".')
    corner: Quantity = about("Radial displacement half a diagonal of the frame from the principal point.")
    shift_row: Quantity = about("Displacement at the principal point.")
    shift_col: Quantity = about("Displacement at the principal point.")
    rms_px: float = about("Rms distance of the corners from the model [px].")
    views: int = about("Number of views and of corners.")
    corners: int = about("Number of views and of corners.")
    curve: tuple[ColourPoint, ...] = about("Displacement against the radius.")


class ColourView(Record, kw_only=False):
    """Corners of one picture, (corner, 2) row before col: places in the frame, and displacements [px]."""

    seen_px: Matrix
    moved_px: Matrix


def find_colours(frame: Frame, found: Found) -> tuple[ColourCorners, ...] | None:
    """Place the corners of a board in each colour of a frame.

    The sites of a colour in a mosaic are weighted by 1/4 [1 2 1] along rows and columns and divided by the
    same sum of weights: linear interpolation, which moves no edge.
    """
    if frame.cfa == "grey":
        return None
    placed = {
        letter: refine(_read_colour(frame, letter), found.fitted[:, ::-1], found.fitted_window_px)
        for letter in _LETTERS
    }
    return tuple(
        ColourCorners(
            channel=letter,
            moved_px=tuple((float(row), float(col)) for col, row in placed[letter] - placed[_REFERENCE]),
        )
        for letter in _LETTERS
        if letter != _REFERENCE
    )


def fit_colour(views: Sequence[ColourView], camera: CameraModel, *, channel: str) -> LateralColour | None:
    """Fit the displacement of one colour's corners.

    With q the vector from the principal point, half the frame's diagonal being 1::

        moved = q (a + b |q|^2) + shift                                  least squares
        C = (n - 1)/n sum over views (p without the view - mean)^2       jackknife

    Corners of one picture share errors of the interpolation between a colour's sites, which depend on where
    its edges lie: hence whole views are left out in turn, and corners are not taken as independent.
    """
    if len(views) < FEWEST_VIEWS:
        return None
    half_px = float(np.hypot(camera.height_px, camera.width_px)) / 2.0
    principal = np.array([camera.cy_px, camera.cx_px])
    normal, right, squares = [], [], 0.0
    for view in views:
        q = (view.seen_px - principal) / half_px
        design = np.zeros((len(q), 2, _TERMS))
        design[:, :, 0] = q
        design[:, :, 1] = q * (q**2).sum(axis=1, keepdims=True)
        design[:, 0, 2] = design[:, 1, 3] = 1.0
        flat = design.reshape(-1, _TERMS)
        normal.append(flat.T @ flat)
        right.append(flat.T @ view.moved_px.ravel())
        squares += float((view.moved_px**2).sum())
    whole, sums = np.sum(normal, axis=0), np.sum(right, axis=0)
    if np.linalg.cond(whole) > 1.0 / np.finfo(float).eps:
        return None
    values = np.linalg.solve(whole, sums)
    without = np.array(
        [np.linalg.solve(whole - one, sums - other) for one, other in zip(normal, right, strict=True)]
    )
    spread = without - without.mean(axis=0)
    covariance = (len(views) - 1) / len(views) * spread.T @ spread
    corners = sum(len(view.seen_px) for view in views)
    reached = max(float(np.linalg.norm(view.seen_px - principal, axis=1).max()) for view in views)

    def state(slopes: Matrix) -> Quantity:
        return Quantity(float(slopes @ values), float(np.sqrt(slopes @ covariance @ slopes)), "px")

    curve = [(radius, state(np.array([radius, radius**3, 0.0, 0.0]))) for radius in np.linspace(0, 1, POINTS)]
    return LateralColour(
        channels=f"{channel}-{_REFERENCE}",
        corner=curve[-1][1],
        shift_row=state(np.eye(_TERMS)[2]),
        shift_col=state(np.eye(_TERMS)[3]),
        rms_px=float(np.sqrt(max(0.0, squares - float(values @ sums)) / corners)),
        views=len(views),
        corners=corners,
        curve=tuple(
            ColourPoint(
                radius_px=float(radius * half_px),
                displacement_px=each.value,
                standard_uncertainty_px=each.standard_uncertainty,
                extrapolated=bool(radius * half_px > reached),
            )
            for radius, each in curve
        ),
    )


def _read_colour(frame: Frame, letter: str) -> NDArray[np.float32]:
    if frame.cfa == "rgb":
        return np.ascontiguousarray(frame.samples_dn[:, :, _LETTERS.index(letter)], np.float32)
    rows, cols = np.indices(frame.samples_dn.shape)
    sites = 2 * ((rows + frame.row0) % 2) + (cols + frame.col0) % 2
    mine = np.isin(sites, [place for place, one in enumerate(frame.cfa) if one == letter])

    def smooth(values: NDArray[np.float32]) -> NDArray[np.float32]:
        smoothed = cv2.sepFilter2D(values, cv2.CV_32F, BINOMIAL, BINOMIAL, borderType=cv2.BORDER_REFLECT_101)
        return np.asarray(smoothed, np.float32)

    return smooth((frame.samples_dn * mine).astype(np.float32)) / smooth(mine.astype(np.float32))


class Features(Record):
    """Corners in one picture, ready for JSON."""

    target: Target  # Board that was searched
    not_found: str  # Reason why there are no corners, else ""
    height_px: int  # Size of the whole frame [px]
    width_px: int
    indices: tuple[int, ...] = ()  # Indices of the corners on the board, row by row
    # (row, col) of each corner [px], from the centre of the frame's first pixel
    fitted_px: tuple[tuple[float, float], ...] = ()
    fitted_window_px: int = 0  # Half side of the window in which they were placed [px]
    spacing_px: float = 0.0  # Shortest distance between neighbours [px]
    # 10 to 90 % rise of the squares' edges [px]; None where the board is not seen whole
    edge_rise_px: float | None = None
    board_share: float = 0.0  # Fraction of the frame that the corners span
    # Colour of the square between the first corners of the first two rows, of a board that differs from its
    # mirror image; else None
    first_square: FirstSquare | None = later()
    # Displacement of red's and blue's corners from those of green; None without colours
    colours: tuple[ColourCorners, ...] | None = later()


def extract_features(
    frame: Frame, regions: Sequence[Region], *, header: FrameHeader, target: Target
) -> Extracted[Features]:
    """Find the board in a window of a frame; a board that is not there is a result and not an error."""
    found = find_corners(make_grey(frame, bits_per_sample=header.bits_per_sample), target)
    statistics = compute_statistics(frame, roi.mask(regions[0].polygon, frame.window))
    return Extracted(statistics=statistics, features=_describe(frame, found, target))


def _describe(frame: Frame, found: Found, target: Target) -> Features:
    if found.not_found:
        return Features(
            target=target, not_found=found.not_found, height_px=frame.height_px, width_px=frame.width_px
        )
    corner = np.array([frame.row0, frame.col0])
    hull = cv2.convexHull(found.fitted.astype(np.float32))
    return Features(
        target=target,
        not_found="",
        height_px=frame.height_px,
        width_px=frame.width_px,
        indices=tuple(int(index) for index in found.indices),
        fitted_px=tuple((float(row), float(col)) for row, col in found.fitted + corner),
        fitted_window_px=found.fitted_window_px,
        spacing_px=found.spacing_px,
        edge_rise_px=found.edge_rise_px,
        board_share=float(cv2.contourArea(hull)) / (frame.height_px * frame.width_px),
        first_square=found.first_square,
        colours=find_colours(frame, found),
    )


CHART: Final = "chart"
RadialTerms = Literal[0, 1, 2, 3]

FrameRow = FrameEvidence[Features]


class Params(Record):
    """Parameters of a geometry fit."""

    pixel_pitch_um: float | None = parameter(
        None,
        label="Pixel pitch",
        description="Distance of neighbouring pixels; without it nothing is reported in millimetres and "
        "micrometres.",
        unit="um",
        default_text="the camera's, where it is registered",
        example=3.28,
        bounds="[0.1, 100]",
    )
    fix_aspect_ratio: bool = parameter(
        default=True, label="Square pixels", description="fx = fy; if free, the two differ by their noise."
    )
    radial_terms: RadialTerms = parameter(
        3,
        label="Radial terms",
        description="How many of k1, k2, k3 are free; the others are 0.",
        labels={0: "None", 1: "k1", 2: "k1, k2", 3: "k1, k2, k3"},
    )
    tangential: bool = parameter(
        default=True, label="Tangential terms", description="p1 and p2 are free; otherwise they are 0."
    )
    reject_above_px: float | None = parameter(
        2.0,
        label="Rejection limit of a view",
        description="A view with a larger rms residual is rejected, the worst first, and the others are "
        "fitted again; `none` keeps every view.",
        unit="px",
        none_allowed=True,
        bounds="(0, 1000]",
    )
    exclude: tuple[Exclusion, ...] = ()

    def __post_init__(self) -> None:
        check_parameters(self)


class Coefficient(Record):
    """One parameter of the camera; the standard uncertainty of one that was not free is 0."""

    name: str
    value: float
    standard_uncertainty: float
    unit: str


class Point(Record):
    """One picture in the fit."""

    frame: str
    used: bool = about("True if the fit used it.")
    left_out: str = about('"" for one that was used, else the reason.')
    corners: int = about("Number of corners.")
    rms_px: float | None = about(
        "Rms and largest of the distances between its corners and the model [px]; for a view that was "
        "rejected, from the camera that the others determine.",
        default=None,
    )
    largest_px: float | None = about(
        "Rms and largest of the distances between its corners and the model [px]; for a view that was "
        "rejected, from the camera that the others determine.",
        default=None,
    )
    tilt_deg: float | None = about(
        "Angle between the board's normal and the optical axis [deg].", default=None
    )
    distance_mm: float | None = about("Distance of its first corner [mm].", default=None)
    spacing_px: float | None = about("Shortest distance between neighbouring corners [px].", default=None)
    edge_rise_px: float | None = about("10 to 90 % rise of the squares' edges [px].", default=None)


class CurvePoint(Record):
    """Radial distortion at one distance from the principal point; negative is towards it (barrel)."""

    radius_px: float = about("Radius at which this lens shows it [px].")
    ideal_radius_px: float = about("Radius at which a lens without distortion would show it [px].")
    distortion_px: float = about("`radius_px` less `ideal_radius_px` [px].")
    standard_uncertainty_px: float
    distortion_um: float | None = about("The same [um]; None without a pixel pitch.")
    standard_uncertainty_um: float | None
    extrapolated: bool = about("True if further out than any corner that was used.")


class Coverage(Record):
    """Coverage of the frame by corners."""

    counts: tuple[tuple[int, ...], ...] = about("Corners in each cell of a grid, (row, col).")
    share: float = about("Fraction of cells with a corner.")
    radius_share: float = about(
        "Covered fraction of the distance from the principal point to the farthest corner of the frame."
    )


class Fit(Record):
    """Geometry calibration."""

    model: str
    target: Target = about("Board that was photographed.")
    pixel_pitch_um: float | None = about("Distance of neighbouring pixels [um]; None if unknown.")
    camera: CameraModel
    coefficients: tuple[Coefficient, ...] = about(
        "Coefficients of which `list_coefficients` returns the values."
    )
    covariance: tuple[tuple[float, ...], ...] = about("Covariance of `camera.PARAMETERS`, (9, 9).")
    rms_px: float = about("Rms residual [px].")
    views: int = about("Number of views and of corners.")
    corners: int = about("Number of views and of corners.")
    degrees_of_freedom: int
    principal_distance_mm: Quantity | None = about("Principal distance [mm]; None without a pixel pitch.")
    offset_row: Quantity = about("Offset of the principal point from the middle of the frame.")
    offset_col: Quantity = about("Offset of the principal point from the middle of the frame.")
    offset_row_um: Quantity | None = about("The same [um]; None without a pixel pitch.")
    offset_col_um: Quantity | None = about("The same [um]; None without a pixel pitch.")
    curve: tuple[CurvePoint, ...] = about("Radial distortion.")
    coverage: Coverage = about("Coverage of the frame by corners.")
    points: tuple[Point, ...]
    flags: tuple[Raised, ...]
    lateral_colour: tuple[LateralColour, ...] | None = later(
        "Displacement of red and blue against green; None where the pictures have no colours."
    )
    birge_ratio: float | None = later(
        "Factor of all uncertainties, 1 or more: how far views disagree over what their corners explain."
    )
    effective_dof: int | None = later("Degrees of freedom of the uncertainties.")


def list_key_figures(result: dict[str, Any]) -> tuple[KeyFigure, ...]:
    """Return the focal length, in mm where the pixel pitch is known, and the principal point."""
    named = {each["name"]: each for each in result["coefficients"]}
    focal = result.get("principal_distance_mm") or named["fx_px"]
    dof, all_dof = result.get("effective_dof"), result["degrees_of_freedom"]
    return (
        *of_quantity("Lens", "Focal length", focal, dof=dof),
        *of_quantity("Principal point", "Column", named.get("cx_px"), dof=dof),
        *of_quantity("Principal point", "Row", named.get("cy_px"), dof=dof),
        *of_quantity("All views", "Error of a corner, rms", named.get("rms_px"), dof=all_dof),
    )


Node = dict[str, Any]


def _build_distortion(result: Node, _: Any) -> Iterator[Figure]:  # noqa: ANN401  no rows are needed
    curve = result["curve"]
    seen = [p for p in curve if not p["extrapolated"]]
    beyond = [*seen[-1:], *(p for p in curve if p["extrapolated"])]
    series = [_draw("within the corners seen", seen, "distortion_px")]
    if len(beyond) > 1:
        series.append(_draw("beyond them", beyond, "distortion_px"))
    yield Figure(
        x=Axis(label="distance from the principal point [px]"),
        y=Axis(label="distortion [px]", include=(0.0,)),
        levels=(0.0,),
        series=tuple(series),
    )


def _draw(name: str, points: list[Node], field: str) -> Series:
    us = [2.0 * p["standard_uncertainty_px"] for p in points]
    line = tuple((p["radius_px"], p[field]) for p in points)
    return Series(
        name=name, line=line, swath=tuple((x, y - u, y + u) for (x, y), u in zip(line, us, strict=True))
    )


def _build_colours(result: Node, _: Any) -> Iterator[Figure]:  # noqa: ANN401
    if colours := result.get("lateral_colour"):
        yield Figure(
            x=Axis(label="distance from the principal point [px]"),
            y=Axis(label="displacement [px]", include=(0.0,)),
            series=tuple(_draw(each["channels"], each["curve"], "displacement_px") for each in colours),
        )


def _build_coverage(result: Node, _: Any) -> Iterator[Figure]:  # noqa: ANN401
    camera, counts = result["camera"], result["coverage"]["counts"]
    height, width = camera["height_px"] / len(counts), camera["width_px"] / len(counts[0])
    most = max(map(max, counts)) or 1
    cells = tuple(
        Cell(
            x=(col * width, (col + 1) * width),
            y=(-(row + 1) * height, -row * height),
            share=count / most,
            told=f"{count} corners",
            text=str(count),
        )
        for row, line in enumerate(counts)
        for col, count in enumerate(line)
    )
    yield Figure(
        x=Axis(label="column [px]"),
        y=Axis(label="row [px]", is_downward=True),
        cells=cells,
        note=f"Corners were seen in {100.0 * result['coverage']['share']:.0f} % of the cells",
    )


def _build_views(result: Node, _: Any) -> Iterator[Figure]:  # noqa: ANN401
    marks = tuple(
        Mark(
            x=float(n),
            y=p["rms_px"],
            name=p["frame"],
            told=(f"rms of its corners {p['rms_px']:.3g} px",),
            frame_id=p.get("frame_id", ""),
            left_out="" if p["used"] else p["left_out"],
        )
        for n, p in enumerate(result["points"], start=1)
        if p.get("rms_px") is not None
    )
    yield Figure(
        x=Axis(label="view, in turn"),
        y=Axis(label="rms of its corners [px]", include=(0.0,)),
        levels=(result["rms_px"],),
        series=(Series(marks=marks),),
        note="Dashed: all views together",
    )


PLOTS: Final = (
    Plot(
        name="distortion",
        title="Radial distortion",
        note="Bands: two standard uncertainties",
        build=_build_distortion,
        most_printed=1,
    ),
    Plot(name="coverage", title="Corners seen", build=_build_coverage, most_printed=1),
    Plot(name="views", title="Error of each view", build=_build_views, most_printed=1),
    Plot(name="colours", title="Lateral colour", build=_build_colours, most_printed=1),
)
