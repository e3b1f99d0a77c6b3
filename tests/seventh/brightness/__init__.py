"""Brightness: the mean raw signal of a region, per ISO value. A method that only the tests have."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

from radiometry.drawing.figure import Axis, Figure, Mark, Plot, Series
from radiometry.findings import InputRejected, Raised, declare, flag, shared
from radiometry.fitting.evidence import CoefficientValue, Exclusion, Extracted, FrameEvidence
from radiometry.frame.roi import Window, mask
from radiometry.frame.statistics import compute_statistics, measure_signal
from radiometry.frame.verdicts import ReviewedFrame, Verdict, conclude, inspect_frames
from radiometry.specification.certificate import FRAME, CertificateText, CoefficientKind, Column
from radiometry.specification.method import MethodSpec
from radiometry.specification.parameters import check_parameters, parameter
from radiometry.specification.roles import FLAT

__all__ = ["SPEC"]

BRIGHTNESS_ONCE = flag("Only one frame has this ISO value.", "Take more frames.", "calibration")
FINDINGS: Final = declare(globals())


@dataclass(frozen=True, kw_only=True)
class Params:
    """Parameters of a brightness fit."""

    offset_dn: float = parameter(
        0.0,
        label="Offset",
        description="Signal that is subtracted from every mean.",
        unit="DN",
        bounds="[0, 65535]",
    )
    exclude: tuple[Exclusion, ...] = ()

    def __post_init__(self) -> None:
        """Check every parameter against its range."""
        check_parameters(self)


@dataclass(frozen=True, kw_only=True)
class Point:
    """One frame, used or left out."""

    frame: str
    used: bool
    left_out: str
    iso: float
    signal_dn: float | None


@dataclass(frozen=True, kw_only=True)
class IsoFit:
    """The mean signal of the frames of one ISO value [DN], and its standard uncertainty."""

    iso: float
    brightness_dn: float
    standard_uncertainty_dn: float


@dataclass(frozen=True, kw_only=True)
class Fit:
    """A brightness calibration."""

    iso_fits: tuple[IsoFit, ...]
    points: tuple[Point, ...]
    flags: tuple[Raised, ...]


Row = FrameEvidence[None]


def extract(frame: Any, regions: Sequence[Any], **_: Any) -> Extracted[None]:
    """Return the statistics of the region."""
    height, width = frame.samples_dn.shape[:2]
    window = Window(row0=frame.row0, col0=frame.col0, height=height, width=width)
    return Extracted(statistics=compute_statistics(frame, mask(regions[0].polygon, window)), features=None)


def missing(
    rows: Sequence[Row], _: Sequence[Any], params: Params, *, unread: Sequence[str] = ()
) -> tuple[str, ...]:
    """Return what the fit still needs, by name."""
    del params
    if unread:
        return tuple(f"frame {name} has not been read" for name in unread)
    return () if any(row.statistics for row in rows) else ("no flat frame with a region",)


def plan(rows: Sequence[Row], _: Sequence[Any], params: Params) -> tuple[str, ...]:
    """Return suggestions for a better fit."""
    del params
    return () if len(rows) > 1 else ("take a second frame",)


def judge(frames: Sequence[ReviewedFrame], *_: Any) -> dict[str, Verdict]:
    """Return the verdict on each frame, by name."""
    return {name: conclude(reasons) for name, reasons in inspect_frames(frames).items()}


def fit(rows: Sequence[Row], _: Sequence[Any], params: Params) -> Fit:
    """Return the mean signal of each ISO value."""
    excluded = {each.frame: each.reason for each in params.exclude}
    signals: dict[float, list[float]] = {}
    points = []
    for row in sorted(rows, key=lambda each: each.frame):
        if row.exposure is None or row.statistics is None:
            continue
        iso = row.exposure.iso
        signal = measure_signal(row.statistics, channel="green").value_dn - params.offset_dn
        if row.frame not in excluded:
            signals.setdefault(iso, []).append(signal)
        reason = excluded.get(row.frame, "")
        points.append(Point(frame=row.frame, used=not reason, left_out=reason, iso=iso, signal_dn=signal))
    if not signals:
        raise InputRejected(shared.FIT_INCOMPLETE, "The fit cannot start: every frame is excluded.")
    fits = tuple(_average(iso, values) for iso, values in sorted(signals.items()))
    flags = tuple(
        Raised(flag=BRIGHTNESS_ONCE.code, where=f"iso {iso:g}", detail="Frames: 1.")
        for iso, values in signals.items()
        if len(values) == 1
    )
    return Fit(iso_fits=fits, points=tuple(points), flags=flags)


def _average(iso: float, values: Sequence[float]) -> IsoFit:
    mean = math.fsum(values) / len(values)
    variance = math.fsum((value - mean) ** 2 for value in values) / max(1, len(values) - 1)
    return IsoFit(iso=iso, brightness_dn=mean, standard_uncertainty_dn=math.sqrt(variance / len(values)))


def list_coefficients(fitted: Fit) -> tuple[CoefficientValue, ...]:
    """Return the brightness of each ISO value."""
    return tuple(
        CoefficientValue(
            name="brightness_dn",
            value=each.brightness_dn,
            standard_uncertainty=each.standard_uncertainty_dn,
            unit="DN",
            model="mean",
            iso=each.iso,
        )
        for each in fitted.iso_fits
    )


def build_plot(result: dict[str, Any], _: Any) -> Iterator[Figure]:
    """Yield the brightness by ISO value."""
    marks = []
    for each in result["iso_fits"]:
        y, u = each["brightness_dn"], 2.0 * each["standard_uncertainty_dn"]
        marks.append(Mark(x=each["iso"], y=y, low=y - u, high=y + u, name=f"ISO {each['iso']:g}"))
    yield Figure(x=Axis(label="ISO"), y=Axis(label="brightness [DN]"), series=(Series(marks=tuple(marks)),))


SPEC: Final = MethodSpec(
    name="brightness",
    label="Brightness",
    description="The mean raw signal of a region per ISO value, from flat frames.",
    schema_version=1,
    roles=(FLAT,),
    params=Params,
    result=Fit,
    coefficients=(CoefficientKind(name="brightness_dn", label="Brightness", units=("DN",)),),
    findings=FINDINGS,
    extract=extract,
    missing=missing,
    judge=judge,
    plan=plan,
    fit=fit,
    list_coefficients=list_coefficients,
    plots=(Plot(name="brightness", title="Brightness", build=build_plot, most_printed=1),),
    certificate=CertificateText(
        procedure="Mean raw signal of a region per ISO value",
        equation="B = mean(N)",
        headlines=frozenset({"brightness_dn"}),
        columns=(FRAME, Column(name="iso", head="ISO"), Column(name="signal_dn", head="signal [DN]")),
        traceability="Raw values are not traceable to a unit of light.",
    ),
)
