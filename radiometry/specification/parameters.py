"""Fields with their sentences, and parameters of a fit: each with its unit, range, default and label."""

import dataclasses
import math
import types
from collections.abc import Callable
from functools import cache
from typing import Any, Final, Literal, Union, get_args, get_origin, get_type_hints

from radiometry.records import LATER, Record, about

Kind = Literal["number", "integer", "boolean", "choice", "interval", "group", "version", "text"]

_KEY: Final = "parameter"


class Choice(Record):
    """One of the values that a parameter may have, and its label."""

    value: str | int
    label: str


class Parameter(Record):
    """One parameter of a fit, as forms, documents and the command line show it."""

    field: str = about("Its name in the `parameters` of versions and in certificates.")
    name: str = about("Its name in requests, the same as `field` but for two older names.")
    label: str
    description: str
    kind: Kind = about(
        '"interval" is a pair, the lower bound first; "group" holds ``members``; "version" names the '
        'calibration version of another method; "text" is a name, or a table of several lines.'
    )
    unit: str = about('"1" for a fraction.', default="1")
    minimum: float | None = about(
        "Bounds, included unless ``above_minimum`` or ``below_maximum`` is True.", default=None
    )
    maximum: float | None = about(
        "Bounds, included unless ``above_minimum`` or ``below_maximum`` is True.", default=None
    )
    above_minimum: bool = False
    below_maximum: bool = False
    choices: tuple[Choice, ...] = ()
    default: Any = about(
        "None if there is none; ``default_text`` then states what the fit does, and ``example`` is a "
        "value that could be given.",
        default=None,
    )
    default_text: str = ""
    example: Any = None
    given_by: Literal["request", "campaign"] = about(
        '"campaign" if the value is part of the campaign and no request may change it.', default="request"
    )
    none_allowed: bool = about('True if the text "none" switches the parameter off.', default=False)
    version_of: str = about(
        'Name of the method whose version a "version" names, otherwise empty.', default=""
    )
    displaced_by: tuple[str, ...] = about(
        "Parameters of a request, any of which states other surroundings than the campaign's: its value "
        "of this one then does not count.",
        default=(),
    )
    suggest: Callable[[], tuple[str, ...]] = about(
        '``() -> tuple of str``, names that a "text" may have.', default=tuple
    )
    members: tuple["Parameter", ...] = ()

    @property
    def range_text(self) -> str:
        """The allowed values in words, such as "above 0 and below 1"; empty if there is no limit."""
        low, high = self.minimum, self.maximum
        if low is not None and high is not None and not (self.above_minimum or self.below_maximum):
            return f"between {low:g} and {high:g}"
        above = "" if low is None else f"{'above' if self.above_minimum else 'at least'} {low:g}"
        below = "" if high is None else f"{'below' if self.below_maximum else 'at most'} {high:g}"
        return " and ".join(part for part in (above, below) if part)

    @property
    def default_shown(self) -> str:
        """The default as a document shows it."""
        match self.default:
            case bool():
                return str(self.default).lower()
            case tuple():
                return " to ".join(f"{each:g}" for each in self.default)
            case int() | float():
                return f"{self.default:.3g}"
            case _:
                return str(self.default)

    def holds(self, value: float) -> bool:
        """Return True if a number lies within the range; NaN and infinity do not."""
        if not math.isfinite(value):
            return False
        low, high = self.minimum, self.maximum
        above = low is None or (value > low if self.above_minimum else value >= low)
        return above and (high is None or (value < high if self.below_maximum else value <= high))


def parameter(
    default: Any,  # noqa: ANN401  of the field's type
    *,
    label: str,
    description: str,
    later: bool = False,
    **stated: Any,  # noqa: ANN401  the other attributes of Parameter
) -> Any:  # noqa: ANN401  a field of a dataclass takes its annotated type
    """Return a dataclass field that carries the description of its parameter."""
    stated |= {"label": label, "description": description}
    if bounds := stated.pop("bounds", ""):
        low, high = bounds[1:-1].split(", ")
        stated |= {"minimum": float(low), "maximum": float(high)}
        stated |= {"above_minimum": bounds[0] == "(", "below_maximum": bounds[-1] == ")"}
    return dataclasses.field(default=default, metadata={_KEY: stated, **(LATER if later else {})})


def list_parameters(kind: type[Any]) -> tuple[Parameter, ...]:
    """Return the parameters that a `Params` class states, in the order of its fields."""
    return _list_once(kind)


def check_parameters(params: Any) -> None:  # noqa: ANN401  of any method
    for each in list_parameters(type(params)):
        value = getattr(params, each.field)
        if value is None:
            continue
        if each.choices and value not in {choice.value for choice in each.choices}:
            allowed = ", ".join(str(choice.value) for choice in each.choices)
            raise ValueError(f"{each.field} must be one of {allowed}")
        if each.kind in ("number", "integer", "interval"):
            numbers = value if isinstance(value, tuple) else (value,)
            if not all(each.holds(number) for number in numbers):
                verb = "lie" if each.range_text.startswith("between") else "be"
                raise ValueError(f"{each.field} must {verb} {each.range_text}")
            if isinstance(value, tuple) and not value[0] < value[1]:
                raise ValueError(f"{each.field} must hold two numbers, the lower first")


def _list(kind: type[Any]) -> tuple[Parameter, ...]:
    hints = get_type_hints(kind)
    return tuple(
        _describe(each, hints[each.name]) for each in dataclasses.fields(kind) if _KEY in each.metadata
    )


_list_once: Callable[[Any], tuple[Parameter, ...]] = cache(_list)


def _describe(field: dataclasses.Field[Any], hint: Any) -> Parameter:  # noqa: ANN401  a type, or a form of one
    stated = dict(field.metadata[_KEY])
    labels = stated.pop("labels", {})
    kind, choices, members = _read_type(hint, labels)
    return Parameter(
        **{
            "field": field.name,
            "name": field.name,
            "kind": kind,
            "choices": choices,
            "members": members,
            "default": field.default,
            **stated,
        }
    )


def _read_type(
    hint: Any,  # noqa: ANN401  a type, or a form of one
    labels: dict[str | int, str],
) -> tuple[Kind, tuple[Choice, ...], tuple[Parameter, ...]]:
    if get_origin(hint) in (Union, types.UnionType):
        (hint,) = (each for each in get_args(hint) if each is not type(None))
    if get_origin(hint) is Literal:
        values = get_args(hint)
        return "choice", tuple(Choice(value=each, label=labels.get(each, str(each))) for each in values), ()
    if get_origin(hint) is tuple:
        return "interval", (), ()
    if dataclasses.is_dataclass(hint) and isinstance(hint, type):
        return "group", (), list_parameters(hint)
    plain: dict[Any, Kind] = {float: "number", int: "integer", bool: "boolean", str: "version"}
    return plain[hint], (), ()
