"""The specification of a calibration method: all that the rest of the product may know of it."""

import itertools
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import field
from functools import cached_property
from types import GenericAlias
from typing import Any, Literal, get_args, get_type_hints

from radiometry.drawing.chart import draw_sheet
from radiometry.drawing.figure import Figure, Plot
from radiometry.findings import Finding, Raised
from radiometry.frame.roi import Polygon
from radiometry.records import Record, about
from radiometry.specification.application import Application, Correction, FoundRegion, Summary
from radiometry.specification.certificate import Budget, CertificateText, CoefficientKind, KeyFigure
from radiometry.specification.exports import Export, RigSpec
from radiometry.specification.parameters import Parameter, list_parameters
from radiometry.specification.roles import Gap, Grid, Role

Reference = Literal["meter", "panel"]
Scope = Literal["traceable", "relative_only"]
ToleranceUnit = Literal["%", "px"]


def _nothing(*_: Any, **__: Any) -> None:  # noqa: ANN401  takes what the function that it replaces takes
    return None


def _none(*_: Any, **__: Any) -> tuple[Any, ...]:  # noqa: ANN401  any fit, or any header
    return ()


def drop_readings(call: Callable[..., Any]) -> Callable[..., Any]:
    def without(rows: Any, readings: Any, params: Any, **named: Any) -> Any:  # noqa: ANN401  the method's own
        del readings
        return call(rows, params, **named)

    return without


_NAMES = "Name in the API, label on pages, and one sentence: what is calibrated, from what."


class MethodSpec(Record):
    """A calibration method."""

    name: str = about(_NAMES)
    label: str = about(_NAMES)
    description: str = about(_NAMES)
    schema_version: int  #: Version of the form in which parameters and results are stored
    roles: tuple[Role, ...]  #: Roles of the frames that the fit uses; the first is the default of a frame
    #: Frozen dataclasses of the parameters and of the fit. The result has `points`, each with its `frame`,
    #: and `flags`.
    params: type[Any]
    result: type[Any]
    coefficients: tuple[CoefficientKind, ...]  #: What the method reports, the most looked-for first
    #: `(frame, regions, *, header, exposure, target) -> Extracted`. `frame` contains the regions' window.
    #: `exposure` is None only for a frame of a chart whose file has none. Raises InputRejected.
    extract: Callable[..., Any]
    #: `(rows, readings, params, *, unread) -> tuple of str`, what a fit still needs, by name; `unread` names
    #: frames that have not been read
    missing: Callable[..., tuple[str, ...]]
    #: `(frames, rows, readings, params) -> dict of Verdict` by the frame's name
    judge: Callable[..., Mapping[str, Any]]
    #: `(rows, readings, params) -> tuple of str`, suggestions for a better fit
    plan: Callable[..., tuple[str, ...]]
    fit: Callable[..., Any]  #: `(rows, readings, params) -> result`. Raises InputRejected.
    list_coefficients: Callable[..., tuple[Any, ...]]  #: `(fitted) -> tuple of CoefficientValue`
    certificate: CertificateText  #: What a certificate prints of the method
    grid: Grid = field(default_factory=Grid)  #: Axes of the grid in which a campaign's frames are shown
    #: `(rows, readings, params) -> tuple of Gap`, the frames to photograph next, with their places
    find_gaps: Callable[..., tuple[Gap, ...]] = field(default=_none)
    findings: tuple[Finding, ...] = ()  #: What only this method finds, for the registry
    #: What a version makes of a later frame, None if it cannot be applied
    application: Application | None = None
    #: Field of `result` with what is applied: fits, each with its `coefficient`, or one model
    applied: str = ""
    #: What a version corrects the signals of another method with, None if it corrects none
    correction: Correction | None = None
    exports: tuple[Export, ...] = ()  #: Forms in which other programs read a version
    #: Orientation of cameras that are mounted together, None if versions say nothing of it
    rig: RigSpec | None = None
    #: `(band) -> light`, the light that a multispectral frame's own sensor recorded. Raises InputRejected.
    measure_light: Callable[..., Any] | None = None
    #: Roles of frames that the coefficients are applied to; they are judged beside the others and need no
    #: region
    applied_roles: tuple[Role, ...] = ()
    #: Frozen dataclass of what `extract` returns beside statistics, None if statistics are enough
    features: type[Any] | None = None
    #: Frozen dataclass that describes what is photographed, None if no description is needed
    target: type[Any] | None = None
    #: A target as a request states it, for documents and forms
    target_example: Mapping[str, Any] | None = None
    reference: Reference | None = about(
        "What a campaign is measured against: meter readings of scenes, or a panel's reflectances.",
        default=None,
    )
    reading: type[Any] = field(default=type(None))  #: Frozen dataclass of one reading of the reference
    #: Flags of a fit that hold for everything that is measured with it too
    passed_on: tuple[Finding, ...] = ()
    #: Flag of a fit whose headline coefficients are relative only: their uncertainty lacks that of the
    #: reference's scale. None if the method states no traceability to one.
    untraced: Finding | None = None
    has_checklist: bool = about(
        "True if the procedure has a checklist that an operator ticks and signs.", default=False
    )
    whole_frame: bool = about("True if the whole frame is used where no region is drawn.", default=False)
    finds_region: bool = about(
        "True if `find_region` looks for the region where none is drawn.", default=False
    )
    several_regions: bool = about(
        "True if a frame usually has several regions, each with a name of its own.", default=False
    )
    tolerance_unit: ToleranceUnit = about(
        "Unit in which one tolerance for all coefficients of a camera or a fleet is meant.", default="%"
    )
    manual_exposure: bool = True  #: True if a camera that chooses its exposure deserves a flag
    #: Plots of a version that pages show, the most looked-for first; what they read of a stored result may be
    #: None or missing if it does not exist
    plots: tuple[Plot, ...] = ()
    #: `(stored result) -> tuple of KeyFigure`, what a person looks for first; empty for the coefficients
    list_key_figures: Callable[[dict[str, Any]], tuple[KeyFigure, ...]] = field(default=_none)
    #: True if a version holds for the flight of its campaign: frames of the campaign are measured with it,
    #: and a plot marks when they were taken (times in ISO 8601 under "flight")
    of_one_flight: bool = False
    #: `(fitted) -> tuple of Budget`, empty if the fit states none
    list_budgets: Callable[[Any], tuple[Budget, ...]] = field(default=_none)
    #: `(header, *, exposure) -> sequence of Raised`, what the method finds in a frame's metadata when it is
    #: read; `frame_left_out` if it has no use for it. Raises InputRejected if the frame cannot be used.
    check_frame: Callable[..., Sequence[Raised]] = field(default=_none)
    #: `(features) -> sequence of Raised`, what the method finds in a frame's features
    check_features: Callable[[Any], Sequence[Raised]] = field(default=_none)
    #: `(frame, *, header) -> found or None`
    find_region: Callable[..., FoundRegion | None] = field(default=_nothing)
    #: `(frame, *, header, other, other_header, region) -> (region, likeness) or None`, where a frame shows
    #: what was found in another band of its capture
    take_region: Callable[..., tuple[Polygon, float] | None] = field(default=_nothing)
    #: `(evidence) -> row`, a frame in the form that the fit takes
    make_row: Callable[..., Any] = field(default=lambda evidence: evidence)
    #: `(fitted) -> mapping`, what a version holds for beside camera and lens, ready for JSON
    configure: Callable[..., Mapping[str, Any]] = field(default=lambda _: {})

    def summarise(self, result: Mapping[str, Any]) -> Summary:
        """Return a stored result of a measurement in the words and figures that others need."""
        if self.application is None:
            raise LookupError(f"{self.name} is not applied to later frames")
        return self.application.summarise(result)

    def find_scope(self, name: str, flags: Collection[str]) -> Scope | None:
        """Return the scope of a coefficient's uncertainty.

        None for a coefficient that does not depend on a reference whose certificate is checked.
        """
        if self.untraced is None or name not in self.certificate.headlines:
            return None
        return "relative_only" if self.untraced.code in flags else "traceable"

    def draw(self, result: dict[str, Any]) -> str:
        """Draw what certificates print of a stored result, as SVG."""
        return draw_sheet(list(self._list_printed(result)), f"{self.label} calibration")

    def _list_printed(self, result: dict[str, Any]) -> Iterator[tuple[str, Figure]]:
        for plot in self.plots:
            for figure in itertools.islice(plot.build(result, tuple), plot.most_printed):
                yield f"{plot.title}, {figure.part}" if figure.part else plot.title, figure

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The parameters of a fit, in the order in which a form shows them."""
        return list_parameters(self.params)

    def label_coefficient(self, name: str) -> str:
        """Return the label of a coefficient, its name if the method does not state it."""
        return next((each.label for each in self.coefficients if each.name == name), name)

    @property
    def conditions(self) -> tuple[Parameter, ...]:
        """Surroundings that a measurement may state."""
        stated = self.application.conditions if self.application else None
        return list_parameters(stated) if stated else ()

    @property
    def measurement_options(self) -> tuple[str, ...]:
        """Options of a measurement with a version, beside region and products."""
        options = self.application.options if self.application else ()
        return (*options, *(each.name for each in self.conditions))

    @property
    def applied_type(self) -> Any:  # noqa: ANN401  a type, or a form of one
        """The type of what is applied to other frames."""
        hint = get_type_hints(self.result)[self.applied]
        parts = get_args(hint)
        if not parts:
            return hint
        return GenericAlias(tuple, (get_type_hints(parts[0])["coefficient"], ...))

    @property
    def corrected_by(self) -> str | None:
        """Name of the method whose version can correct a fit, such as vignetting; None if there is none."""
        return next((each.version_of for each in self.parameters if each.kind == "version"), None)

    @property
    def point(self) -> type[Any]:
        """Frozen dataclass of one point of a fit."""
        point: type[Any] = get_args(get_type_hints(self.result)["points"])[0]
        return point

    @cached_property
    def role_names(self) -> frozenset[str]:
        """Names of the roles that the fit uses."""
        return frozenset(role.name for role in self.roles)

    @cached_property
    def applied_role_names(self) -> frozenset[str]:
        return frozenset(role.name for role in self.applied_roles)
