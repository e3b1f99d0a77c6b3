"""Coefficients that a method reports: kind, effect of a difference, and uncertainty budget."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal


@dataclass(frozen=True, kw_only=True)
class Budget:
    """The uncertainty budget of one coefficient.

    Attributes
    ----------
    holds_for : mapping
        What the coefficient holds for, such as its ISO value or band.
    lines : tuple
        Frozen dataclasses, one per source.
    """

    holds_for: Mapping[str, Any]
    lines: tuple[Any, ...]


@dataclass(frozen=True, kw_only=True)
class CoefficientEffect:
    """Effect of a difference of a coefficient on what is made with it.

    Attributes
    ----------
    of : str
        What is affected, for sentences: "of the luminance".
    unit : {"%", "px"}
        Unit of the effect.
    factor : callable or None
        ``(means) -> float``, the effect per unit of the coefficient, from the mean of each coefficient by
        name; nan if one is missing. None if the effect is the difference relative to the mean.
    """

    of: str
    unit: Literal["%", "px"] = "%"
    factor: Callable[[Mapping[str, float]], float] | None = None


@dataclass(frozen=True, kw_only=True)
class CoefficientKind:
    """A coefficient that a method reports.

    Attributes
    ----------
    units : tuple of str
        Its unit; several if it depends on the camera or on a parameter.
    effect : CoefficientEffect or None
        None if its difference has no effect but itself.
    """

    name: str
    label: str
    units: tuple[str, ...]
    effect: CoefficientEffect | None = None
