"""Comparison of two versions of the same JSON, leaf by leaf: the same, the same to rounding, or different."""

from collections.abc import Iterator, Sequence
from math import inf, sqrt
from typing import Any, Final, Literal

from radiometry.records import Record

Agreement = Literal["same", "rounding", "different"]

ABSENT: Final = "absent"
ROUNDING_REL: Final = 1e-9
"""Largest difference relative to a number's scale that counts as rounding.

Another processor or numeric library changes single operations by 1e-16; cancellation and iterations amplify
that.
"""
_LAST_DIGITS_REL: Final = 1e-14  # difference of a number that is rounding, however small its uncertainty is
_SERIES: Final = 16  # fewest numbers of a list that are samples of one quantity, not parameters of several
_U: Final = "standard_uncertainty"
_QUANTITY: Final = frozenset({"value", _U, "expanded_uncertainty"})


class Row(Record, kw_only=False):
    """One quantity, as the certificate has it and as it was recomputed.

    ``scale``: of a number its standard uncertainty where one is stated, else the largest of its column,
    series or matrix; 0 where there is none of these, and the number itself counts.
    """

    group: str
    quantity: str
    certificate: Any
    recomputed: Any
    scale: float = 0.0

    @property
    def same(self) -> bool:
        """Equal to the last bit; True is not 1, while 1 and 1.0 are the same number."""
        stated, found = self.certificate, self.recomputed
        return isinstance(stated, bool) == isinstance(found, bool) and bool(stated == found)

    @property
    def agreement(self) -> Agreement:
        """How the two agree."""
        if self.same:
            return "same"
        return "rounding" if self.relative <= ROUNDING_REL else "different"

    @property
    def relative(self) -> float:
        """Difference of two numbers relative to their scale; infinite for counts and other values."""
        stated, found = self.certificate, self.recomputed
        if not (_is_number(stated) and _is_number(found)) or (type(stated) is int and type(found) is int):
            return inf
        difference, size = abs(found - stated), max(abs(stated), abs(found))
        if difference <= _LAST_DIGITS_REL * size:
            return float(difference / size) if size else 0.0
        return float(difference / (self.scale or size))

    @property
    def difference(self) -> str:
        """By how much two numbers differ, relative to the certificate's."""
        stated, found = self.certificate, self.recomputed
        if self.same or not (_is_number(stated) and _is_number(found)):
            return ""
        return f"{(found - stated) / abs(stated):+.2e}" if stated else f"{found:+.3g} (absolute)"


def compare(
    group: str,
    certificate: Any,  # noqa: ANN401  JSON
    recomputed: Any,  # noqa: ANN401  JSON
    name: str = "",
    scale: Any = 0.0,  # noqa: ANN401  as the JSON
) -> Iterator[Row]:
    """Yield every leaf of two JSON values; what only one of them has differs.

    ``scale`` : of a number, or of those of an object by name, or of those of a list in their order
    """
    if isinstance(certificate, dict) and isinstance(recomputed, dict):
        columns = scale if isinstance(scale, dict) else {}
        for key in sorted(certificate.keys() | recomputed.keys()):
            yield from compare(
                group,
                certificate.get(key, ABSENT),
                recomputed.get(key, ABSENT),
                f"{name}.{key}".lstrip("."),
                _find_uncertainty(certificate, key) or columns.get(key, 0.0),
            )
    elif isinstance(certificate, list) and isinstance(recomputed, list):
        if len(certificate) != len(recomputed):
            yield Row(group, f"{name} count".strip(), len(certificate), len(recomputed))
        scales = scale if isinstance(scale, list) else _scale_members(certificate)
        for index, (stated, found) in enumerate(zip(certificate, recomputed, strict=False)):
            yield from compare(group, stated, found, f"{name}[{index}]", scales[index])
    else:
        size = scale if isinstance(scale, float) else 0.0
        yield Row(group, name, certificate, recomputed, size)


def take_stated(stated: Any, found: Any) -> Any:  # noqa: ANN401  JSON
    """Return what was found, with the stated number wherever the two are the same to rounding."""
    if isinstance(stated, dict) and isinstance(found, dict):
        return {key: take_stated(stated.get(key, ABSENT), value) for key, value in found.items()}
    return stated if Row("", "", stated, found).agreement == "rounding" else found


def _find_uncertainty(node: dict[str, Any], key: str) -> float | list[float]:
    """Return the standard uncertainty that is stated beside a number or list of parameters, else 0."""
    if key == "parameters" and isinstance(node.get(key), list):
        rows = node.get("covariance", [])
        return [sqrt(abs(row[i])) for i, row in enumerate(rows)] if len(rows) == len(node[key]) else 0.0
    if not _is_number(node.get(key)):
        return 0.0
    for name, value in node.items():
        beside = name.replace(f"_{_U}", "") if name != _U else "value"
        if name != key and beside == key and _is_number(value):
            return abs(float(value))
    return 0.0


def _scale_members(values: list[Any]) -> Sequence[Any]:
    """Return the scale of each member of a list, by what the list is."""
    if values and all(isinstance(value, dict) for value in values):
        names = {name for value in values for name in value} - _QUANTITY
        return [{name: _find_largest([value.get(name) for value in values]) for name in names}] * len(values)
    if values and all(isinstance(row, list) and all(map(_is_number, row)) for row in values):
        if _is_covariance(values):
            roots = [sqrt(values[index][index]) for index in range(len(values))]
            return [[left * right for right in roots] for left in roots]
        # of a table: what cancels in one of its numbers has the size of the others
        largest = _find_largest([number for row in values for number in row])
        return [[largest] * len(row) for row in values]
    return [_find_largest(values) if len(values) >= _SERIES else 0.0] * len(values)


def _find_largest(values: list[Any]) -> float:
    return float(max((abs(value) for value in values if _is_number(value)), default=0.0))


def _is_covariance(rows: list[list[float]]) -> bool:
    """Return True for a square table that is symmetric to rounding, with a diagonal not below 0."""
    return all(len(row) == len(rows) and row[index] >= 0.0 for index, row in enumerate(rows)) and all(
        abs(value - rows[other][index]) <= ROUNDING_REL * sqrt(row[index] * rows[other][other])
        for index, row in enumerate(rows)
        for other, value in enumerate(row)
    )


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
