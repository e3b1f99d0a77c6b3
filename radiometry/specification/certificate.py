"""Reports of a version: certificate text, coefficients with their budgets, and key figures."""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Literal

from radiometry.specification.parameters import about

Form = Literal["text", "number", "percent"]


@dataclass(frozen=True, kw_only=True)
class Column:
    """One printed value of a point. ``name`` : its field; ``share`` : relative width of the column."""

    name: str
    head: str
    form: Form = "number"
    share: float = 1.0


@dataclass(frozen=True, kw_only=True)
class CertificateText:
    """Certificate text of one method.

    ``headlines`` : coefficients on the first page; all others have a table of their own
    ``layout`` : "curve" for a method that fits a curve per ISO value, with sheets of its own
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
    layout: Literal["general", "curve"] = "general"
    traceability: str = ""
    vignetting: str = "none"
    holds_for_lens: bool = True
    statements: tuple[str, ...] = ()
    state: Callable[[Mapping[str, Any], Mapping[str, Any]], tuple[str, ...]] = lambda *_: ()


FRAME: Final = Column(name="frame", head="frame", form="text", share=2.4)


@dataclass(frozen=True, kw_only=True)
class Budget:
    """The uncertainty budget of one coefficient."""

    holds_for: Mapping[str, Any]  # What the coefficient holds for, such as its ISO value or band
    lines: tuple[Any, ...]  # Frozen dataclasses, one per source


@dataclass(frozen=True, kw_only=True)
class CoefficientEffect:
    """Effect of a difference of a coefficient on what is made with it."""

    of: str  # What is affected, for sentences: "of the luminance"
    unit: Literal["%", "px"] = "%"  # Unit of the effect
    # `(means) -> float`, the effect per unit of the coefficient, from the mean of each coefficient by name;
    # nan if one is missing. None if the effect is the difference relative to the mean.
    factor: Callable[[Mapping[str, float]], float] | None = None


@dataclass(frozen=True, kw_only=True)
class CoefficientKind:
    """A coefficient that a method reports."""

    name: str
    label: str
    units: tuple[str, ...] = field(
        metadata=about("Its unit; several if it depends on the camera or on a parameter.")
    )
    effect: CoefficientEffect | None = field(
        default=None, metadata=about("None if its difference has no effect but itself.")
    )


_FIRST_CHANNELS = ("luminance", "G", "G1", "green", "grey")


_FOR_95_PERCENT = about("For a coverage probability of 95 %; None if the version does not state them.")


@dataclass(frozen=True, kw_only=True)
class KeyFigure:
    """One figure of a version."""

    group: str = field(metadata=about("What it holds for, such as an ISO value, and the quantity."))
    label: str = field(metadata=about("What it holds for, such as an ISO value, and the quantity."))
    value: float = field(metadata=about("In ``unit``."))
    standard_uncertainty: float = field(metadata=about("In ``unit``."))
    unit: str = field(metadata=about('Unit, "1" for a pure number.'))
    expanded_uncertainty: float | None = field(default=None, metadata=_FOR_95_PERCENT)
    coverage_factor: float | None = field(default=None, metadata=_FOR_95_PERCENT)
    passed: bool | None = field(default=None, metadata=about("Verdict on it; None if there is none."))


def of_quantity(
    group: str, label: str, quantity: Mapping[str, Any] | None, *, percent: bool = False
) -> tuple[KeyFigure, ...]:
    """Return the figure of a stored quantity, nothing if there is none."""
    if quantity is None:
        return ()
    scale = 100.0 if percent else 1.0
    return (
        KeyFigure(
            group=group,
            label=label,
            value=scale * quantity["value"],
            standard_uncertainty=scale * quantity["standard_uncertainty"],
            unit="%" if percent else quantity["unit"],
        ),
    )


def choose_channel(channels: Iterable[str]) -> str:
    """Return the channel that stands for brightness, else the first."""
    named: Collection[str] = tuple(channels)
    return next((name for name in _FIRST_CHANNELS if name in named), next(iter(named)))
