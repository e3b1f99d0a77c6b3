"""A version applied: V at places, over regions and of every pixel, and in the forms that others read."""

import itertools
import json
import math
from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import shared
from radiometry.fitting.evidence import Quantity
from radiometry.frame.packing import unpack
from radiometry.frame.roi import Polygon, Window, bounding_window, mask
from radiometry.records import Record
from radiometry.specification import exports
from radiometry.vignetting.blocks import Site, Vector, list_channels
from radiometry.vignetting.falloff import Matrix, evaluate_curve, propagate
from radiometry.vignetting.results import ChannelFit, Coefficient, Fit

GREENS = ("G1", "G2")
BAND_ROWS = 256


class Share(Record, kw_only=False):
    """V at some places and its standard uncertainty, arrays of one shape; a signal over V is corrected."""

    share: Matrix  # V at each place
    standard_uncertainty: Matrix  # Standard uncertainty of V

    @property
    def gain(self) -> Matrix:
        return np.asarray(1.0 / self.share)


def evaluate(
    coefficients: Sequence[Coefficient], row_px: Matrix, col_px: Matrix, *, channel: str, f_number: float
) -> Share:
    """Compute V of a channel at places of the frame, at an f-number within the range of the flats.

    At an f-number of the flats::

        V = 1 + k1 r^2 + k2 r^4 + k3 r^6,   u(V)^2 = J C J' + (model_u_rel V)^2

    Between two f-numbers a and b, V is interpolated linearly in log2 of the f-number::

        V = (1 - w) V_a + w V_b,  w = log2(N / N_a) / log2(N_b / N_a)
        u(V)^2 = (1 - w)^2 u(V_a)^2 + w^2 u(V_b)^2 + (4 w (1 - w) (V_b - V_a) / (2 sqrt 3))^2

    The last term is included because the true value may lie anywhere between the neighbours: a rectangular
    distribution that closes at both.
    """
    ends = []
    for coefficient, weight in bracket(coefficients, channel=channel, f_number=f_number):
        value, slopes = coefficient.evaluate(np.asarray(row_px), np.asarray(col_px))
        of_curve = propagate(slopes, np.array(coefficient.covariance))
        ends.append((weight, value, np.asarray(np.hypot(of_curve, coefficient.model_u_rel * value))))
    return _interpolate(ends)


def bracket(
    coefficients: Sequence[Coefficient], *, channel: str, f_number: float
) -> tuple[tuple[Coefficient, float], ...]:
    own = sorted((each for each in coefficients if each.channel == channel), key=lambda each: each.f_number)
    if not own:
        known = ", ".join(dict.fromkeys(each.channel for each in coefficients)) or "none"
        raise shared.VIGNETTING_NOT_CALIBRATED.reject(
            f"The vignetting calibration has no channel {channel}; it has {known}. Calibrate with flats of "
            "the same kind of frame."
        )
    if not own[0].f_number <= f_number <= own[-1].f_number:
        raise shared.VIGNETTING_NOT_CALIBRATED.reject(
            f"f/{f_number:g} is outside the calibrated range, f/{own[0].f_number:g} to "
            f"f/{own[-1].f_number:g}: nothing is extrapolated. Take flats at f/{f_number:g}."
        )
    for each in own:
        if each.f_number == f_number:
            return ((each, 1.0),)
    lower, higher = next(
        pair for pair in itertools.pairwise(own) if pair[0].f_number < f_number < pair[1].f_number
    )
    weight = math.log2(f_number / lower.f_number) / math.log2(higher.f_number / lower.f_number)
    return (lower, 1.0 - weight), (higher, weight)


def require_format(coefficients: Sequence[Coefficient], *, height_px: int, width_px: int) -> None:
    """Check that frames have the size of the calibration: another crop or binning has another centre."""
    sizes = {(each.height_px, each.width_px) for each in coefficients}
    if sizes != {(height_px, width_px)}:
        known = ", ".join(f"{width} x {height}" for height, width in sorted(sizes)) or "no"
        raise shared.VIGNETTING_NOT_CALIBRATED.reject(
            f"The frame is {width_px} x {height_px} pixels, the vignetting was calibrated with {known}: "
            "another crop or binning. Set the camera as for the flats."
        )


def select_channels(coefficients: Sequence[Coefficient], *, signal: str) -> tuple[str, ...]:
    """Return the channels whose mean a signal is: both greens for "green", all for "grey"."""
    channels = tuple(dict.fromkeys(each.channel for each in coefficients))
    greens = tuple(channel for channel in channels if channel in (*GREENS, "G"))
    return greens if signal == "green" and greens else channels


def list_windows(height_px: int, width_px: int) -> Iterator[Window]:
    """Return the bands of rows of a frame, so that a whole map needs little memory."""
    for row0 in range(0, height_px, BAND_ROWS):
        yield Window(row0=row0, col0=0, height=min(BAND_ROWS, height_px - row0), width=width_px)


def _interpolate(ends: Sequence[tuple[float, Matrix, Matrix]]) -> Share:
    value = np.sum([weight * share for weight, share, _ in ends], axis=0)
    variance = np.sum([(weight * u) ** 2 for weight, _, u in ends], axis=0)
    if len(ends) == 2:
        variance = variance + (spread_between(ends[1][0]) * (ends[1][1] - ends[0][1])) ** 2
    return Share(share=np.asarray(value), standard_uncertainty=np.asarray(np.sqrt(variance)))


def spread_between(weight: float) -> float:
    """Return the standard uncertainty between two f-numbers, as a multiple of the difference of their V."""
    return 4.0 * weight * (1.0 - weight) / (2.0 * math.sqrt(3.0))


_End = tuple[Coefficient, float, float, Matrix]  # with its weight, and at the place: V and its slopes


class LensShare(Record):
    """V at a place or over a region, and the effect of each independent error of its calibration on it."""

    value: float  # V
    # Change of V by one standard uncertainty of each source, with its sign. At one f-number, for the same
    # channels, the sources have one order: what two places share is the same error in both.
    effects: tuple[float, ...]

    @property
    def standard_uncertainty(self) -> float:
        """Standard uncertainty of the value, all sources together."""
        return math.hypot(*self.effects)

    @property
    def quantity(self) -> Quantity:
        return Quantity(self.value, self.standard_uncertainty, "1")


class Lens(Record):
    """Vignetting version at the f-number of a frame."""

    coefficients: tuple[Coefficient, ...]  # All coefficients of the version
    f_number: float

    def require(self, *, channels: Sequence[str], height_px: int, width_px: int) -> None:
        """Check that the version is valid for frames of a format."""
        require_format(self.coefficients, height_px=height_px, width_px=width_px)
        for channel in channels:
            bracket(self.coefficients, channel=channel, f_number=self.f_number)

    def over(self, polygon: Polygon, *, channels: Sequence[str]) -> LensShare:
        """Compute the mean of V over a region, averaged over channels.

        The parameters' errors are shared by all pixels of the region: they enter by the mean of V's slopes.
        """
        return _combine(
            [
                [(each, weight, *average_curve(each, polygon)) for each, weight in self._bracket(channel)]
                for channel in channels
            ]
        )

    def at(self, row_px: int, col_px: int, *, channels: Sequence[str]) -> LensShare:
        """Compute V at one pixel's centre, averaged over channels."""
        row, col = np.array(float(row_px)), np.array(float(col_px))

        def resolve(channel: str) -> list[_End]:
            found = [(each, w, *each.evaluate(row, col)) for each, w in self._bracket(channel)]
            return [(each, weight, float(value), slopes) for each, weight, value, slopes in found]

        return _combine([resolve(channel) for channel in channels])

    def compute_plane(
        self, rows_px: NDArray[np.intp], cols_px: NDArray[np.intp], *, channel: str
    ) -> NDArray[np.float32]:
        """Compute V of a channel at rows and columns, without its uncertainty: a tenth of the work."""
        plane = np.zeros((rows_px.size, cols_px.size))
        for coefficient, weight in self._bracket(channel):
            centre, radius = coefficient.centre_px, coefficient.radius_px
            squared = ((rows_px - centre[0]) / radius)[:, None] ** 2 + ((cols_px - centre[1]) / radius) ** 2
            plane += weight * evaluate_curve(squared, coefficient.k)
        return plane.astype(np.float32)

    def _bracket(self, channel: str) -> tuple[tuple[Coefficient, float], ...]:
        return bracket(self.coefficients, channel=channel, f_number=self.f_number)


def average_over_polygon(
    coefficients: Sequence[Coefficient], polygon: Polygon, *, channels: Sequence[str], f_number: float
) -> Quantity:
    """Compute the mean of V over a region, averaged over channels.

    A uniform surface's mean signal is divided by it.

    u^2 = sum over channels of J C J' / m^2 + (model term)^2 + (interpolation term)^2, J the mean of V's
    slopes over the region, since the parameters' errors are shared by all of its pixels. The model's and the
    interpolation's error are taken as alike in the whole region and in all channels: they do not average out.
    """
    return Lens(coefficients=tuple(coefficients), f_number=f_number).over(polygon, channels=channels).quantity


def average_curve(coefficient: Coefficient, polygon: Polygon) -> tuple[float, Matrix]:
    """Compute the means of V and of its slopes over a region's pixels, a band of rows at a time."""
    whole = bounding_window(polygon, height_px=coefficient.height_px, width_px=coefficient.width_px)
    total, slopes_total, count = 0.0, np.zeros(len(coefficient.covariance)), 0
    for band in list_windows(whole.height, whole.width):
        window = Window(row0=whole.row0 + band.row0, col0=whole.col0, height=band.height, width=band.width)
        rows, cols = np.nonzero(mask(polygon, window))
        value, slopes = coefficient.evaluate(
            (rows + window.row0).astype(np.float64), (cols + window.col0).astype(np.float64)
        )
        total += float(value.sum())
        slopes_total += slopes.sum(axis=1)
        count += rows.size
    return total / count, slopes_total / count


def _combine(channels: Sequence[Sequence[_End]]) -> LensShare:
    """Average over channels and between f-numbers; correlated parameters as independent combinations."""
    count = len(channels)
    value = model = between = 0.0
    effects: list[float] = []
    for ends in channels:
        for coefficient, weight, mean, slopes in ends:
            value += weight * mean / count
            model += weight * coefficient.model_u_rel * mean / count
            variances, directions = np.linalg.eigh(np.array(coefficient.covariance))
            combined = slopes @ (directions * np.sqrt(np.maximum(variances, 0.0)))
            effects += (weight / count * combined).tolist()
        if len(ends) == 2:
            between += spread_between(ends[1][1]) * (ends[1][2] - ends[0][2]) / count
    return LensShare(value=value, effects=(*effects, model, between))


def compute_correction(
    coefficients: Sequence[Coefficient], *, cfa: str, f_number: float
) -> NDArray[np.float32]:
    """Compute 1 / V of every pixel, each with its own channel's curve.

    The signal above dark is multiplied by it.
    """
    first, lens = coefficients[0], Lens(coefficients=tuple(coefficients), f_number=f_number)
    gains = np.empty((first.height_px, first.width_px, 3 if cfa == "rgb" else 1), np.float32)
    for each in list_channels(cfa, first.channel):
        site = each.site
        _fill(gains[site.row0 :: site.step, site.col0 :: site.step, each.plane], lens, each.name, site)
    return gains if cfa == "rgb" else gains[..., 0]


def _fill(gains: NDArray[np.float32], lens: Lens, channel: str, site: Site) -> None:
    """Write one channel's gains at its own pixels, a band of rows at a time."""
    cols = np.arange(gains.shape[1]) * site.step + site.col0
    for top in range(0, gains.shape[0], BAND_ROWS):
        band = gains[top : top + BAND_ROWS]
        rows = (top + np.arange(band.shape[0])) * site.step + site.row0
        np.divide(1.0, lens.compute_plane(rows, cols, channel=channel), out=band)


_TERMS = 3  # of Lensfun's model "pa"
_SAMPLES = 129  # Along each side of the frame: odd, so that the middle is one of them


def export_lensfun(
    coefficients: Sequence[Coefficient], *, channels: Sequence[str], names: exports.LensfunNames
) -> str:
    """Write a Lensfun database with the camera, the lens, and one vignetting element per f-number.

    Model "pa" is V itself [1]: light times 1 + k1 r^2 + k2 r^4 + k3 r^6, r = 1 at the half diagonal, from
    the middle of the frame: the database's schema has no centre for a lens [2]. V is therefore refitted
    about the middle; a comment beside each element states the remaining error. V is the mean over channels.

    [1] Lensfun manual, "Lens calibration data format"
    [2] lensfun-database.xsd of Lensfun's database
    """
    elements = [
        _write_element(coefficients, f_number, channels, names)
        for f_number in sorted({each.f_number for each in coefficients})
    ]
    first = coefficients[0]
    return exports.write_database(
        names,
        elements,
        width_px=first.width_px,
        height_px=first.height_px,
        widest_f_number=min(each.f_number for each in coefficients),
    )


def _write_element(
    coefficients: Sequence[Coefficient], f_number: float, channels: Sequence[str], names: exports.LensfunNames
) -> str:
    first = coefficients[0]
    middle_row, middle_col = (first.height_px - 1) / 2.0, (first.width_px - 1) / 2.0

    def average(rows: Vector, cols: Vector) -> Vector:
        found = [evaluate(coefficients, rows, cols, channel=name, f_number=f_number) for name in channels]
        return np.asarray(np.mean([each.share for each in found], axis=0))

    rows = np.linspace(0.0, first.height_px - 1.0, _SAMPLES)[:, None]
    cols = np.linspace(0.0, first.width_px - 1.0, _SAMPLES)[None, :]
    # Lensfun's r is 1 at the centre of the corner pixel
    squared = ((rows - middle_row) ** 2 + (cols - middle_col) ** 2) / (middle_row**2 + middle_col**2)
    # about another point V is not 1: the level there is divided out, as a correction may
    wanted = average(rows, cols) / average(np.array([middle_row]), np.array([middle_col]))
    (k1, k2, k3), error = _fit_even_powers(np.asarray(squared), wanted)
    return (
        f"            <!-- f/{f_number:g}: largest error of the curve about the middle {error:.2%} -->\n"
        f'            <vignetting model="pa" focal="{names.focal_length_mm:.9g}" aperture="{f_number:.9g}" '
        f'distance="{names.distance_m:.9g}" k1="{k1:.9g}" k2="{k2:.9g}" k3="{k3:.9g}"/>'
    )


def _fit_even_powers(squared: Vector, wanted: Vector) -> tuple[tuple[float, ...], float]:
    """Fit 1 + k1 r^2 + k2 r^4 + k3 r^6 to values; return the k, and the largest relative error."""
    powers = np.stack([squared.ravel() ** power for power in range(1, _TERMS + 1)], axis=1)
    target = wanted.ravel()
    found = np.linalg.lstsq(powers / target[:, None], 1.0 - 1.0 / target, rcond=None)[0]
    error = float(np.abs((1.0 + powers @ found) / target - 1.0).max())
    return tuple(float(each) for each in found), error


def find_fit(fits: Sequence[ChannelFit], *, f_number: float, channel: str) -> ChannelFit:
    for fit in fits:
        if (fit.coefficient.f_number, fit.coefficient.channel) == (f_number, channel):
            return fit
    known = ", ".join(f"f/{each.coefficient.f_number:g} {each.coefficient.channel}" for each in fits)
    raise shared.VIGNETTING_NOT_CALIBRATED.reject(
        f"No flat was fitted at f/{f_number:g}, channel {channel}; there are {known}. Ask for one of these."
    )


_F_NUMBER: Final = exports.ExportOption(name="f_number", kind="number")
_CHANNEL: Final = exports.ExportOption(name="channel", kind="text")


def _write_lensfun(fitted: Fit, subject: exports.ExportSubject, options: dict[str, Any]) -> str:
    coefficients = fitted.coefficients
    first = coefficients[0]
    names = exports.name_for_lensfun(subject, options, width_px=first.width_px, height_px=first.height_px)
    return export_lensfun(coefficients, channels=select_channels(coefficients, signal="green"), names=names)


def _write_correction(fitted: Fit, _: exports.ExportSubject, options: dict[str, Any]) -> exports.Picture:
    gains = compute_correction(fitted.coefficients, cfa=fitted.cfa, f_number=options["f_number"])
    return exports.Picture(samples=gains)


def _write_residuals(fitted: Fit, subject: exports.ExportSubject, options: dict[str, Any]) -> exports.Picture:
    fit = find_fit(fitted.channel_fits, **options)
    said = {
        "quantity": "(light - fitted) / fitted",
        "unit": "1",
        **options,
        "block_px": fit.block_px,
        "residual_rms_rel": fit.residual_rms_rel,
        "calibration_id": subject.calibration_id,
    }
    return exports.Picture(samples=unpack(fit.residuals).astype(np.float32), description=json.dumps(said))


EXPORTS: Final = (
    exports.Export(
        filename="lensfun.xml",
        label="Lensfun",
        media_type="application/xml",
        operation="get_lensfun_xml",
        description="The falloff as an entry of Lensfun's database. The pixel pitch must be registered with "
        "the camera.",
        write=_write_lensfun,
        options=exports.list_options(needs_widest=False),
        needs_pixel_pitch=True,
    ),
    exports.Export(
        filename="correction.tif",
        label="Correction map",
        media_type="image/tiff",
        operation="get_correction_map",
        description="1 / V of every pixel, float32: multiply what lies above dark by it, each pixel by its "
        "own channel's.",
        write=_write_correction,
        options=(_F_NUMBER,),
    ),
    exports.Export(
        filename="residuals.tif",
        label="Residual map",
        media_type="image/tiff",
        operation="get_residual_map",
        description="What the curve leaves of the flats, (light - fitted) / fitted, float32: a pixel for "
        "each block.\n\nNaN where a block did not count. The description says how many pixels of the frame a "
        "block is wide.",
        write=_write_residuals,
        options=(_F_NUMBER, _CHANNEL),
    ),
)
