"""THE list of methods. A method is one file here, one name in `Method`, one case in each `match` below.

`Method` is closed: a case that is missing fails the type check at `assert_never`. What a method's rows,
readings, parameters and fit are is its own affair; those who carry them from one function to the next
need not know.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, assert_never, get_args

from radiometry.fitting.evidence import Extracted, Figure, FrameEvidence, Region
from radiometry.frame import Frame, FrameHeader
from radiometry.frame.exposure import Exposure
from radiometry.frame.verdicts import Taken, Verdict
from radiometry.geometry import method as geometry
from radiometry.luminance import method as luminance
from radiometry.noise import method as noise
from radiometry.reflectance import method as reflectance
from radiometry.sharpness import method as sharpness
from radiometry.vignetting import method as vignetting

Method = Literal["luminance", "reflectance", "vignetting", "sharpness", "geometry", "noise"]

METHODS: tuple[Method, ...] = get_args(Method)


@dataclass(frozen=True, kw_only=True)
class Room:
    """What others must know of a method to carry its things.

    ``schema_version`` : of the form in which its parameters and results are stored
    ``roles`` : of the frames that its fit sees; ``applied_roles`` : of those that only `apply` sees,
        which are judged beside them and need no region
    ``features`` : its figures of one frame, None where statistics are all; ``target`` : what is photographed,
        None where nobody need say
    ``whole_frame`` : it looks at the whole frame where nobody has drawn a region
    ``finds_region`` : it looks for the region itself in a frame of its roles where nobody has drawn one
    ``manual_exposure`` : a camera that chooses its exposure is something to know
    """

    schema_version: int
    roles: frozenset[str]
    params: type[Any]
    applied_roles: frozenset[str] = frozenset()
    features: type[Any] | None = None
    target: type[Any] | None = None
    whole_frame: bool = False
    finds_region: bool = False
    manual_exposure: bool = True


def describe(method: Method) -> Room:
    """Give what others must know of a method."""
    match method:
        case "luminance":
            return Room(
                schema_version=luminance.SCHEMA_VERSION, roles=luminance.ROLES, params=luminance.Params
            )
        case "reflectance":
            return Room(
                schema_version=reflectance.SCHEMA_VERSION,
                roles=reflectance.ROLES,
                params=reflectance.Params,
                applied_roles=reflectance.APPLIED_ROLES,
                features=reflectance.Features,
                finds_region=True,
                manual_exposure=False,
            )
        case "vignetting":
            return Room(
                schema_version=vignetting.SCHEMA_VERSION,
                roles=vignetting.ROLES,
                params=vignetting.Params,
                features=vignetting.Features,
                whole_frame=True,
            )
        case "sharpness":
            return Room(
                schema_version=sharpness.SCHEMA_VERSION,
                roles=sharpness.ROLES,
                params=sharpness.Params,
                features=sharpness.Features,
                target=sharpness.Target,
                manual_exposure=False,
            )
        case "geometry":
            return Room(
                schema_version=geometry.SCHEMA_VERSION,
                roles=geometry.ROLES,
                params=geometry.Params,
                features=geometry.Features,
                target=geometry.Target,
                whole_frame=True,
                manual_exposure=False,
            )
        case "noise":
            return Room(
                schema_version=noise.SCHEMA_VERSION,
                roles=noise.ROLES,
                params=noise.Params,
                features=noise.Features,
                whole_frame=True,
            )
        case _:
            assert_never(method)


def extract(
    method: Method,
    frame: Frame,
    regions: Sequence[Region],
    *,
    header: FrameHeader,
    exposure: Exposure | None,
    target: Any = None,  # noqa: ANN401 (the method's own)
) -> Extracted[Any]:
    """Give what one frame says in its regions; ``exposure`` is None only for a chart that states none."""
    match method:
        case "luminance":
            return Extracted(statistics=luminance.extract(frame, regions[0].polygon), features=None)
        case "reflectance":
            return reflectance.extract(frame, regions, header=header, exposure=exposure)
        case "vignetting":
            return vignetting.extract(frame, regions, header=header, exposure=exposure)
        case "sharpness":
            return sharpness.extract(frame, regions, header=header, exposure=exposure, target=target)
        case "geometry":
            return geometry.extract(frame, regions, header=header, exposure=exposure, target=target)
        case "noise":
            return noise.extract(frame, regions, header=header, exposure=exposure)
        case _:
            assert_never(method)


def find_region(method: Method, frame: Frame, *, header: FrameHeader) -> reflectance.FoundPanel | None:
    """Find what is measured in a whole frame; None where it is not certain, or the method does not look."""
    match method:
        case "reflectance":
            return reflectance.find_region(frame, header=header)
        case "luminance" | "vignetting" | "sharpness" | "geometry" | "noise":
            return None
        case _:
            assert_never(method)


def make_row(method: Method, evidence: FrameEvidence[Any]) -> Any:  # noqa: ANN401 (the method's own)
    """Give a frame as the method's fit wants it."""
    match method:
        case "luminance":
            return luminance.make_row(evidence)
        case "reflectance":
            return reflectance.make_row(evidence)
        case "vignetting" | "sharpness" | "geometry" | "noise":
            return evidence
        case _:
            assert_never(method)


def missing(
    method: Method,
    rows: Sequence[Any],
    readings: Sequence[Any],
    params: Any,  # noqa: ANN401 (the method's own)
    *,
    unread: Sequence[str] = (),
) -> tuple[str, ...]:
    """Say, by name, what a fit still lacks; ``unread`` names frames of which nothing is known yet."""
    match method:
        case "luminance":
            return luminance.missing(rows, readings, params, unread=unread)
        case "reflectance":
            return reflectance.missing(rows, readings, params, unread=unread)
        case "vignetting":
            return vignetting.missing(rows, params, unread=unread)
        case "sharpness":
            return sharpness.missing(rows, params, unread=unread)
        case "geometry":
            return geometry.missing(rows, params, unread=unread)
        case "noise":
            return noise.missing(rows, params, unread=unread)
        case _:
            assert_never(method)


def judge(
    method: Method,
    frames: Sequence[Taken],
    rows: Sequence[Any],
    readings: Sequence[Any],
    params: Any,  # noqa: ANN401 (the method's own)
) -> dict[str, Verdict]:
    """Give the verdict on each frame of a campaign, by name; ``rows`` are those that a fit would see."""
    match method:
        case "luminance":
            return luminance.judge(frames, rows, readings, params)
        case "reflectance":
            return reflectance.judge(frames, rows, readings, params)
        case "vignetting":
            return vignetting.judge(frames, rows, params)
        case "sharpness":
            return sharpness.judge(frames, rows, params)
        case "geometry":
            return geometry.judge(frames, rows, params)
        case "noise":
            return noise.judge(frames, rows, params)
        case _:
            assert_never(method)


def plan(
    method: Method,
    rows: Sequence[Any],
    readings: Sequence[Any],
    params: Any,  # noqa: ANN401 (the method's own)
) -> tuple[str, ...]:
    """Say, by name, what would make a fit good."""
    match method:
        case "luminance":
            return luminance.plan(rows, readings, params)
        case "reflectance":
            return reflectance.plan(rows, readings, params)
        case "vignetting":
            return vignetting.plan(rows, params)
        case "sharpness":
            return sharpness.plan(rows, params)
        case "geometry":
            return geometry.plan(rows, params)
        case "noise":
            return noise.plan(rows, params)
        case _:
            assert_never(method)


def fit(
    method: Method,
    rows: Sequence[Any],
    readings: Sequence[Any],
    params: Any,  # noqa: ANN401 (the method's own)
) -> Any:  # noqa: ANN401 (the method's own)
    """Fit a campaign: a dataclass with `points`, each with its `frame`, and `flags`."""
    match method:
        case "luminance":
            return luminance.fit(rows, readings, params)
        case "reflectance":
            return reflectance.fit(rows, readings, params)
        case "vignetting":
            return vignetting.fit(rows, params)
        case "sharpness":
            return sharpness.fit(rows, params)
        case "geometry":
            return geometry.fit(rows, params)
        case "noise":
            return noise.fit(rows, params)
        case _:
            assert_never(method)


def list_figures(method: Method, fitted: Any) -> tuple[Figure, ...]:  # noqa: ANN401 (the method's own)
    """Give a fit's coefficients as dashboards see them, the most looked-for first."""
    match method:
        case "luminance":
            return luminance.list_figures(fitted)
        case "reflectance":
            return reflectance.list_figures(fitted)
        case "vignetting":
            return vignetting.list_figures(fitted)
        case "sharpness":
            return sharpness.list_figures(fitted)
        case "geometry":
            return geometry.list_figures(fitted)
        case "noise":
            return noise.list_figures(fitted)
        case _:
            assert_never(method)


def configure(method: Method, fitted: Any) -> Mapping[str, Any]:  # noqa: ANN401 (the method's own)
    """Give what a fit holds for beside the camera and its lens, ready for JSON."""
    match method:
        case "luminance" | "vignetting" | "sharpness" | "geometry" | "noise":
            return {}
        case "reflectance":
            return reflectance.configure(fitted)
        case _:
            assert_never(method)
