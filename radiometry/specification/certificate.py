"""Reports of a version: certificate text, coefficients with their budgets, and key figures."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import Any, Final, Literal

from radiometry.fitting.curve import coverage_factor
from radiometry.records import Record, about


class Column(Record):
    """One printed value of a point. ``name`` : its field; ``share`` : relative width of the column."""

    name: str
    head: str
    form: Literal["text", "number", "percent"] = "number"
    share: float = 1.0


class CertificateText(Record):
    """Certificate text of one method.

    ``headlines`` : coefficients on the first page; all others have a table of their own
    ``verdicts`` : ``(result) -> (largest residual, passed)`` of each headline in its order, or of none
    ``describe`` : ``(result) -> (label, text)``, what is to be said of the fit beside its coefficients
    ``columns`` : of the points; without `FRAME` they stand beside the frames, of which each is one point
    ``traceability`` : "" where it depends on the meters or panels used
    ``vignetting`` : what corrected the signals, where no vignetting version did
    ``holds_for_lens`` : the result is valid for one lens; a certificate without a lens then has a gap
    ``statements`` : statements that only this method makes
    ``state`` : ``(parameters, result) -> tuple of str``, those that depend on the version
    """

    procedure: str
    equation: str
    headlines: frozenset[str]
    columns: tuple[Column, ...]
    verdicts: Callable[[Mapping[str, Any]], Sequence[tuple[float, bool]]] = lambda _: ()
    describe: Callable[[Mapping[str, Any]], Iterable[tuple[str, str]]] = lambda _: ()
    traceability: str = ""
    vignetting: str = "none"
    holds_for_lens: bool = True
    statements: tuple[str, ...] = ()
    state: Callable[[Mapping[str, Any], Mapping[str, Any]], tuple[str, ...]] = lambda *_: ()


FRAME: Final = Column(name="frame", head="frame", form="text", share=2.4)


class Budget(Record):
    """The uncertainty budget of one coefficient."""

    holds_for: Mapping[str, Any]  # What the coefficient holds for, such as its ISO value or band
    lines: tuple[Any, ...]  # Frozen dataclasses, one per source


class CoefficientEffect(Record):
    """Effect of a difference of a coefficient on what is made with it."""

    of: str  # What is affected, for sentences: "of the luminance"
    unit: Literal["%", "px"] = "%"  # Unit of the effect
    # `(means) -> float`, the effect per unit of the coefficient, from the mean of each coefficient by name;
    # nan if one is missing. None if the effect is the difference relative to the mean.
    factor: Callable[[Mapping[str, float]], float] | None = None


class CoefficientKind(Record):
    """A coefficient that a method reports."""

    name: str
    label: str
    units: tuple[str, ...] = about("Its unit; several if it depends on the camera or on a parameter.")
    effect: CoefficientEffect | None = about("None if its difference has no effect but itself.", default=None)


_FIRST_CHANNELS = ("luminance", "G", "G1", "green", "grey")


_FOR_95_PERCENT = "For a coverage probability of 95 %; None if the version does not state them."


class KeyFigure(Record):
    """One figure of a version."""

    group: str = about("What it holds for, such as an ISO value, and the quantity.")
    label: str = about("What it holds for, such as an ISO value, and the quantity.")
    value: float = about("In ``unit``.")
    standard_uncertainty: float = about("In ``unit``.")
    unit: str = about('Unit, "1" for a pure number.')
    expanded_uncertainty: float | None = about(_FOR_95_PERCENT, default=None)
    coverage_factor: float | None = about(_FOR_95_PERCENT, default=None)
    passed: bool | None = about("Verdict on it; None if there is none.", default=None)


def of_quantity(
    group: str, label: str, quantity: Mapping[str, Any] | None, *, dof: float | None
) -> tuple[KeyFigure, ...]:
    """Return the figure of a stored quantity, with U where its degrees of freedom are known."""
    if quantity is None:
        return ()
    stated = {name: quantity[name] for name in ("value", "standard_uncertainty", "unit")}
    if dof is not None:
        factor = coverage_factor(dof)
        expanded = factor * stated["standard_uncertainty"]
        stated |= {"expanded_uncertainty": expanded, "coverage_factor": factor}
    return (KeyFigure(group=group, label=label, **stated),)


def of_coefficient(group: str, label: str, stored: Mapping[str, Any], name: str, **more: Any) -> KeyFigure:  # noqa: ANN401  its other fields
    """Return the figure of a stored coefficient that states its own expanded uncertainty."""
    return KeyFigure(
        group=group,
        label=label,
        value=stored[name],
        standard_uncertainty=stored[f"{name}_standard_uncertainty"],
        unit=stored[f"{name}_unit"],
        expanded_uncertainty=stored.get("expanded_uncertainty"),
        coverage_factor=stored.get("coverage_factor"),
        **more,
    )


def choose_channel(channels: Iterable[str]) -> str:
    """Return the channel that stands for brightness, else the first."""
    named: Collection[str] = tuple(channels)
    return next((name for name in _FIRST_CHANNELS if name in named), next(iter(named)))
