"""Features of a frame, parameters and results of a noise fit, ready for JSON, and their figures and plots."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from radiometry.drawing.figure import MOST, Axis, Figure, Mark, Plot, Series
from radiometry.drawing.text import write_exposure
from radiometry.findings import Raised, shared
from radiometry.fitting.evidence import MOST_DOF, Exclusion, Extracted, FrameEvidence, Quantity, Region
from radiometry.frame import Frame, FrameHeader, packing, roi
from radiometry.frame.statistics import GREY, compute_statistics, name_site
from radiometry.records import Record, about
from radiometry.specification.certificate import KeyFigure, choose_channel, of_quantity
from radiometry.specification.parameters import check_parameters, parameter

LARGEST_SIDE = 96  # Samples along a side. 9216 of them give the variance of a pair within 1.5 %.

SMALLEST_SIDE = 16  # 256 samples: a variance within 9 %, below which few levels give no gain worth its name


class ChannelBlock(Record):
    """Square of raw samples of one channel, black included."""

    # R, G1, G2, B for a mosaic; R, G, B for a rendered image; grey; or the name of a multispectral band
    channel: str
    row0: int  # Position of its first sample in the visible area [px]
    col0: int
    step: int  # Distance to the next sample of the channel [px]
    samples_dn: packing.Packed  # Raw samples [DN]
    clipped_share: float  # Fraction of samples at or above the white level
    zero_share: float  # Fraction of samples that are 0
    black_level_dn: float
    white_level_dn: float


class Features(Record):
    """A frame's blocks, ready for JSON: all of the same place and size."""

    blocks: tuple[ChannelBlock, ...]


FrameRow = FrameEvidence[Features]


def extract_features(frame: Frame, regions: Sequence[Region], *, header: FrameHeader) -> Extracted[Features]:
    """Read the largest square about the middle of the first region, at most 96 samples a side and channel.

    In a mosaic the square consists of whole 2 x 2 cells, so that every channel has the same place. It is
    the same square in every frame of one region: differences of frames are differences of the same pixels.
    """
    inside = roi.require_pixels(roi.mask(regions[0].polygon, frame.window))
    step = 1 if frame.cfa in (GREY, "rgb") else 2
    skip_row, skip_col = frame.row0 % step, frame.col0 % step
    cells = _join_cells(inside[skip_row:, skip_col:], step)
    row, col, side = _find_square(cells)
    part = frame.samples_dn[
        skip_row + row * step : skip_row + (row + side) * step,
        skip_col + col * step : skip_col + (col + side) * step,
    ]
    at = (frame.row0 + skip_row + row * step, frame.col0 + skip_col + col * step)
    band = header.multispectral.band if header.multispectral else GREY
    blocks = tuple(
        _describe(samples, channel, frame, level=level, at=(at[0] + offset[0], at[1] + offset[1]), step=step)
        for channel, level, offset, samples in _split(part, frame.cfa, band)
    )
    return Extracted(statistics=compute_statistics(frame, inside), features=Features(blocks=blocks))


def _join_cells(inside: NDArray[np.bool_], step: int) -> NDArray[np.bool_]:
    rows, cols = inside.shape[0] // step, inside.shape[1] // step
    cut = inside[: rows * step, : cols * step].reshape(rows, step, cols, step)
    return np.asarray(cut.all(axis=(1, 3)), np.bool_)


def _find_square(cells: NDArray[np.bool_]) -> tuple[int, int, int]:
    """Return row, column and side of the largest square of cells about the middle of the region."""
    spans = [np.flatnonzero(cells.any(axis=axis)) for axis in (1, 0)]
    if all(span.size for span in spans):
        middles = [int(span[0] + span[-1] + 1) for span in spans]  # twice the middle
        most = min(LARGEST_SIDE, *(int(span[-1] - span[0] + 1) for span in spans))
        for side in range(most, SMALLEST_SIDE - 1, -1):
            row, col = ((middle - side) // 2 for middle in middles)
            if cells[row : row + side, col : col + side].all():
                return row, col, side
    raise shared.ROI_EMPTY.reject(
        f"The region holds no square of {SMALLEST_SIDE} x {SMALLEST_SIDE} samples of every channel in its "
        "middle: draw it larger."
    )


def _split(
    part: NDArray[np.uint16], cfa: str, band: str
) -> Iterator[tuple[str, int, tuple[int, int], NDArray[np.uint16]]]:
    """Return channel, index of its levels, offset and samples of each plane."""
    if cfa == "rgb":
        for plane, name in enumerate("RGB"):
            yield name, plane, (0, 0), part[..., plane]
    elif cfa == GREY:
        yield band, 0, (0, 0), part
    else:
        for site in range(4):
            row, col = divmod(site, 2)
            yield name_site(cfa, site), site, (row, col), part[row::2, col::2]


def _describe(
    samples: NDArray[np.uint16], channel: str, frame: Frame, *, level: int, at: tuple[int, int], step: int
) -> ChannelBlock:
    white = frame.white_level_dn[level % len(frame.white_level_dn)]
    return ChannelBlock(
        channel=channel,
        row0=at[0],
        col0=at[1],
        step=step,
        samples_dn=packing.pack(samples, dtype="<u2"),
        clipped_share=float(np.mean(samples >= white)),
        zero_share=float(np.mean(samples == 0)),
        black_level_dn=frame.black_level_dn[level % len(frame.black_level_dn)],
        white_level_dn=white,
    )


LIGHT, FLAT, DARK = "light", "flat", "dark"


class Params(Record):
    """Parameters of a noise fit; the defaults are those of EMVA 1288."""

    gain_range_share: float = parameter(
        0.70,
        label="Upper end of the photon transfer fit",
        description="The photon transfer is fitted up to this fraction of saturation.",
        bounds="(0, 1]",
    )
    linearity_range_share: tuple[float, float] = parameter(
        (0.05, 0.95),
        label="Range of the linearity fit",
        description="Range of the straight line of the linearity error, as fractions of saturation.",
        bounds="(0, 1]",
    )
    largest_drift_rel: float = parameter(
        0.10,
        label="Largest drift of the light",
        description="Stacks whose frames differ more in their means are left out, because their light "
        "changed.",
        bounds="(0, 1]",
    )
    exclude: tuple[Exclusion, ...] = ()

    def __post_init__(self) -> None:
        check_parameters(self)


SaturationOrigin = Literal["white_level", "variance_maximum", "white_level_assumed"]

TRANSFER_EQUATION = "var_y - var_dark = K (mu_y - mu_dark)"


class LevelResult(Record):
    """Lit stack in the photon transfer, the SNR curve and the linearity."""

    role: str
    scene: str
    f_number: float
    exposure_time_s: float
    frames: int = about("Number of frames.")
    signal_dn: float = about("Mean above that of its dark frames [DN].")
    light_dn: float = about("Mean above the dark signal of its own time [DN].")
    excess_dn2: float | None = about(
        "Temporal variance above that of the dark frames, and its standard uncertainty [DN^2]; None if "
        "a single frame shows no noise."
    )
    excess_u_dn2: float | None = about(
        "Temporal variance above that of the dark frames, and its standard uncertainty [DN^2]; None if "
        "a single frame shows no noise."
    )
    snr: float | None = about("Light over temporal noise; None if a single frame shows no noise.")
    snr_standard_uncertainty: float | None
    residual_dn2: float | None = about("Excess - K signal [DN^2].")
    deviation_rel: float | None = about("Relative deviation from the straight line of the linearity.")
    left_out: str = about('Reason why it is not in the photon transfer; "" if it is.')


class TransferFigures(Record):
    """Coefficients of the photon transfer, by the names of EMVA 1288."""

    system_gain_dn_per_e: Quantity = about("System gain K [DN/e-].")
    read_noise_e: Quantity = about("Temporal dark noise without rounding [e-].")
    sensitivity_threshold_e: Quantity = about("Sensitivity threshold mu_e.min [e-].")
    saturation_dn: Quantity = about("Saturation above dark [DN].")
    saturation_origin: SaturationOrigin = about("How the saturation was found.")
    full_well_e: Quantity = about("Saturation capacity mu_e.sat [e-].")
    snr_max: Quantity = about("Largest signal-to-noise ratio, sqrt(mu_e.sat).")
    dynamic_range: Quantity = about("Dynamic range mu_e.sat / mu_e.min as a ratio, in dB and in stops.")
    dynamic_range_db: Quantity = about("Dynamic range mu_e.sat / mu_e.min as a ratio, in dB and in stops.")
    dynamic_range_stops: Quantity = about("Dynamic range mu_e.sat / mu_e.min as a ratio, in dB and in stops.")
    dsnu_e: Quantity
    levels_used: int = about("Number of levels in the line.")
    birge_ratio: float = about("Birge ratio and chi squared of their scatter about the line.")
    chi_squared: float = about("Birge ratio and chi squared of their scatter about the line.")


class LinearityFigures(Record):
    """Linearity error of one channel at one ISO value."""

    error_rel: Quantity = about("Mean of the absolute deviations LE.")
    lowest_rel: float = about("Extreme deviations, LE_min and LE_max of release 3.0.")
    highest_rel: float = about("Extreme deviations, LE_min and LE_max of release 3.0.")
    levels_used: int = about("Number of levels on the line.")


class DarkCurrentFigures(Record):
    """Dark current, in electrons if K is known."""

    dark_current_dn_per_s: Quantity = about("Dark current from the mean [DN/s].")
    dark_current_e_per_s: Quantity | None = about(
        "Dark current from the mean [e-/s]; None if K is not known."
    )
    from_variance_e_per_s: Quantity | None = about(
        "Dark current from the variance [e-/s], which a camera that subtracts its dark current cannot "
        "hide; None if it is not known."
    )


class ChannelFit(Record):
    """Results of one channel at one ISO value."""

    iso: float = about("ISO value.")
    channel: str
    dark_signal_dn: float = about("Dark signal of the shortest dark frames [DN].")
    read_noise_dn: Quantity
    dsnu_dn: Quantity
    prnu_rel: Quantity | None = about("PRNU, relative.")
    transfer: TransferFigures | None = about("Coefficients of the photon transfer.")
    linearity: LinearityFigures | None = about("Linearity error.")
    dark_current: DarkCurrentFigures | None
    levels: tuple[LevelResult, ...] = about("Levels of the photon transfer.")
    effective_dof: dict[str, float] = about(
        "Effective degrees of freedom of the uncertainties, by coefficient, at most 1e6; empty in "
        "versions from before they were evaluated.",
        default_factory=dict,
    )


class Point(Record):
    """One channel of one frame."""

    frame: str
    channel: str
    role: str
    scene: str | None
    iso: float | None = about("ISO value.")
    f_number: float | None
    exposure_time_s: float | None
    mean_dn: float | None = about("Mean of the samples [DN].")
    clipped_share: float | None = about("Fraction of samples at or above the white level.")
    frames_of_setting: int = about(
        "Number of frames that share its role, scene, ISO, time and f-number, itself included."
    )
    used: bool = about("True if the fit used it.")
    left_out: str = about('Reason why it was not used; "" if it was.')


class Fit(Record):
    """A noise calibration: every channel at every ISO value, every point, every flag."""

    channel_fits: tuple[ChannelFit, ...]
    points: tuple[Point, ...]
    flags: tuple[Raised, ...]


_FIGURES = (("full_well_e", "Full well"), ("read_noise_e", "Read noise"), ("snr_max", "Largest SNR"))


def list_key_figures(result: dict[str, Any]) -> tuple[KeyFigure, ...]:
    fits = result["channel_fits"]
    shown = choose_channel(fit["channel"] for fit in fits)
    return tuple(
        figure
        for fit in fits
        if fit["channel"] == shown
        for name, label in _FIGURES
        for figure in of_quantity(
            f"ISO {fit['iso']:g}",
            label,
            (fit.get("transfer") or {}).get(name),
            dof=(fit.get("effective_dof") or {name: None}).get(name, MOST_DOF),
        )
    )


Node = dict[str, Any]
Build = Callable[[Node, Any], Iterator[Figure]]


def _draw(x: str, y: str, labels: tuple[str, str], predict: Callable[[float, float], float]) -> Build:
    """Return what draws a field of the levels against another, with what the gain predicts."""

    def build(result: Node, _: Any) -> Iterator[Figure]:  # noqa: ANN401  no rows are needed
        for iso, fits in _by_iso(result):
            series = []
            for fit in fits:
                levels = [each for each in fit["levels"] if (each.get(y) or 0.0) > 0.0 and each[x] > 0.0]
                model: list[tuple[float, float]] = []
                if levels and fit.get("transfer"):
                    gain = fit["transfer"]["system_gain_dn_per_e"]["value"]
                    ends = [each[x] for each in levels]
                    along = np.geomspace(min(ends) / 1.5, 1.5 * max(ends), 61).tolist()
                    model = [(at, predict(at, gain)) for at in along]
                marks = tuple(_mark(fit, each, each[x], each[y], labels[1]) for each in levels)
                series.append(Series(name=fit["channel"], marks=marks, model=tuple(model)))
            x_axis, y_axis = (Axis(label=f"{label}, logarithmic", logarithmic=True) for label in labels)
            yield Figure(part=iso, x=x_axis, y=y_axis, series=tuple(series))

    return build


def _build_linearity(result: Node, _: Any) -> Iterator[Figure]:  # noqa: ANN401
    for iso, fits in _by_iso(result):
        series = []
        for fit in fits:
            levels = [each for each in fit["levels"] if each.get("deviation_rel") is not None]
            marks = (
                _mark(fit, p, p["light_dn"], 100.0 * p["deviation_rel"], "deviation [%]") for p in levels
            )
            series.append(Series(name=fit["channel"], marks=tuple(marks)))
        if any(each.marks for each in series):
            y = Axis(label="from the straight line [%]", include=(-0.5, 0.5))
            yield Figure(part=iso, x=Axis(label="light [DN]"), y=y, series=tuple(series), levels=(0.0,))


def _mark(fit: Node, level: Node, x: float, y: float, label: str) -> Mark:
    told = (write_exposure(level["exposure_time_s"]), f"{label.partition(' [')[0]} {y:.4g}")
    return Mark(x=x, y=y, name=f"channel {fit['channel']}", told=told, left_out=level["left_out"])


def _by_iso(result: Node) -> Iterator[tuple[str, list[Node]]]:
    for iso in sorted({fit["iso"] for fit in result["channel_fits"]}):
        yield f"ISO {iso:g}", [fit for fit in result["channel_fits"] if fit["iso"] == iso]


PLOTS: Final = (
    Plot(
        name="transfer",
        title="Photon transfer",
        note="Line: the system gain",
        build=_draw(
            "signal_dn",
            "excess_dn2",
            ("signal above dark [DN]", "variance [DN²]"),
            lambda signal, gain: gain * signal,
        ),
        most_printed=MOST,
    ),
    Plot(
        name="snr",
        title="Signal-to-noise ratio",
        note="Line: photons alone",
        build=_draw(
            "light_dn",
            "snr",
            ("light [DN]", "signal / noise"),
            lambda light, gain: float((light / gain) ** 0.5),
        ),
        most_printed=MOST,
    ),
    Plot(name="linearity", title="Linearity", build=_build_linearity, most_printed=MOST),
)
