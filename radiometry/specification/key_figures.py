"""The few figures of a version that a person looks for first."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

_FIRST_CHANNELS = ("luminance", "G", "G1", "green", "grey")


@dataclass(frozen=True, kw_only=True)
class KeyFigure:
    """One figure of a version.

    Attributes
    ----------
    group, label : str
        What it holds for, such as an ISO value, and the quantity.
    value, standard_uncertainty : float
        In ``unit``.
    unit : str
        Unit, "1" for a pure number.
    expanded_uncertainty, coverage_factor : float or None
        For a coverage probability of 95 %; None if the version does not state them.
    passed : bool or None
        Verdict on it; None if there is none.
    """

    group: str
    label: str
    value: float
    standard_uncertainty: float
    unit: str
    expanded_uncertainty: float | None = field(default=None)
    coverage_factor: float | None = field(default=None)
    passed: bool | None = field(default=None)


def of_quantity(
    group: str, label: str, quantity: Mapping[str, Any] | None, *, percent: bool = False
) -> tuple[KeyFigure, ...]:
    """Return the figure of a stored quantity, nothing if there is none.

    Parameters
    ----------
    group, label : str
        What it holds for, and its name.
    quantity : mapping or None
        Value, standard uncertainty and unit.
    percent : bool, optional
        True for a fraction that is shown in %.
    """
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
    """Return the channel that stands for brightness, else the first.

    Parameters
    ----------
    channels : iterable of str
        Names of the channels.
    """
    named: Collection[str] = tuple(channels)
    return next((name for name in _FIRST_CHANNELS if name in named), next(iter(named)))
