"""THE list of methods. A method is one file here, one name in `Method`, one case in each `match` below.

`Method` and the unions are closed: a case that is missing fails the type check at `assert_never`.
"""

from collections.abc import Sequence
from typing import Literal, assert_never, get_args

from radiometry.exposure import Exposure
from radiometry.frame import Frame
from radiometry.methods import luminance
from radiometry.roi import Polygon
from radiometry.statistics import ChannelStatistics
from radiometry.verdicts import Taken, Verdict

Method = Literal["luminance"]
Params = luminance.Params
FrameRow = luminance.FrameRow
Reading = luminance.Reading
Fit = luminance.Fit
Coefficient = luminance.Coefficient
Applied = luminance.AppliedLuminance

METHODS: tuple[Method, ...] = get_args(Method)


def schema_version(method: Method) -> int:
    """Give the version of the form in which a method's parameters and results are stored."""
    match method:
        case "luminance":
            return luminance.SCHEMA_VERSION
        case _:
            assert_never(method)


def extract(method: Method, frame: Frame, polygon: Polygon) -> tuple[ChannelStatistics, ...]:
    """Give a frame's row of features in a region."""
    match method:
        case "luminance":
            return luminance.extract(frame, polygon)
        case _:
            assert_never(method)


def missing(
    method: Method,
    rows: Sequence[FrameRow],
    readings: Sequence[Reading],
    params: Params,
    *,
    unread: Sequence[str] = (),
) -> tuple[str, ...]:
    """Say, by name, what a fit still lacks; ``unread`` names frames of which nothing is known yet."""
    match method:
        case "luminance":
            return luminance.missing(rows, readings, params, unread=unread)
        case _:
            assert_never(method)


def judge(
    method: Method,
    frames: Sequence[Taken],
    rows: Sequence[FrameRow],
    readings: Sequence[Reading],
    params: Params,
) -> dict[str, Verdict]:
    """Give the verdict on each frame of a campaign, by name; ``rows`` are those that a fit would see."""
    match method:
        case "luminance":
            return luminance.judge(frames, rows, readings, params)
        case _:
            assert_never(method)


def plan(
    method: Method, rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params
) -> tuple[str, ...]:
    """Say, by name, what would make a fit good."""
    match method:
        case "luminance":
            return luminance.plan(rows, readings, params)
        case _:
            assert_never(method)


def fit(method: Method, rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params) -> Fit:
    """Fit a campaign."""
    match method:
        case "luminance":
            return luminance.fit(rows, readings, params)
        case _:
            assert_never(method)


def apply(
    method: Method,
    statistics: Sequence[ChannelStatistics],
    *,
    exposure: Exposure,
    coefficients: Sequence[Coefficient],
) -> Applied:
    """Apply a calibration to a new frame."""
    match method:
        case "luminance":
            return luminance.apply(statistics, exposure=exposure, coefficients=coefficients)
        case _:
            assert_never(method)
