"""Between the science's dataclasses and what the tables keep."""

import json
from collections.abc import Callable, Collection
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any, get_args, get_type_hints

from pydantic import TypeAdapter

from radiometry.frame import FrameHeader, exposure
from radiometry.methods import get_method
from store.tables import Calibration, Json

decode_header: Callable[[Json], FrameHeader] = TypeAdapter(FrameHeader).validate_python
decode_exposure: Callable[[Json], exposure.Exposure] = TypeAdapter(exposure.Exposure).validate_python
# one a type, built once: building an adapter costs far more than using it
_adapter: Callable[[Any], TypeAdapter[Any]] = cache(TypeAdapter)


def encode(value: Any) -> Any:  # noqa: ANN401
    """A dataclass as plain JSON values; tuples become lists, so that what is stored equals what is read."""
    plain = _adapter(type(value)).dump_python(value, mode="json")
    later = _list_later(type(value))
    return drop_absent(plain, later) if later else plain


def decode(kind: Any, stored: Any) -> Any:  # noqa: ANN401
    return _adapter(kind).validate_python(stored)


def read_text(kind: Any, text: str | None) -> Any:  # noqa: ANN401
    """Return a dataclass from the text of a JSON column; None where nothing is kept."""
    return None if text is None or text == "null" else _adapter(kind).validate_json(text)


def read_strictly(kind: type[Any], said: Any) -> Json:  # noqa: ANN401
    """Return plain JSON values as a dataclass wants them, with its defaults."""
    text = json.dumps(json.loads(json.dumps(said), parse_float=_read_number))
    found = _adapter(kind).validate_json(text, strict=True, extra="forbid")
    plain: Json = drop_absent(encode(found))
    return plain


def _read_number(text: str) -> float:
    number = float(text)
    return int(number) if number.is_integer() else number


def _find_later(kind: Any) -> frozenset[str]:  # noqa: ANN401
    """Return the names of fields that older versions do not have, of a type and of all that it holds."""
    found: set[str] = set()
    if is_dataclass(kind):
        hints = get_type_hints(kind)
        for each in fields(kind):
            found |= {each.name} if each.metadata.get("later") else set()
            found |= _list_later(hints[each.name])
    for part in get_args(kind):
        found |= _list_later(part)
    return frozenset(found)


_list_later: Callable[[Any], frozenset[str]] = cache(_find_later)


def drop_absent(value: Any, among: Collection[str] | None = None) -> Any:  # noqa: ANN401
    """The same without what does not exist, of all names or these: absent is left out, never null."""
    if isinstance(value, dict):
        return {
            name: drop_absent(member, among)
            for name, member in value.items()
            if member is not None or (among is not None and name not in among)
        }
    return [drop_absent(member, among) for member in value] if isinstance(value, list) else value


def read_applied(calibration: Calibration) -> Any:  # noqa: ANN401  the method's own
    """Return what a version applies to other frames: its coefficients, or its one model."""
    spec = get_method(calibration.method)
    stored = calibration.result[spec.applied]
    plain = [fit["coefficient"] for fit in stored] if isinstance(stored, list) else stored
    return decode(spec.applied_type, plain)
