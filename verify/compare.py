"""Two versions of the same thing, leaf by leaf: what is not equal to the last bit differs."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

ABSENT = "absent"


@dataclass(frozen=True, kw_only=True)
class Row:
    """One quantity, as the certificate has it and as it was found."""

    group: str
    quantity: str
    certificate: Any
    recomputed: Any

    @property
    def same(self) -> bool:
        """Equal to the last bit; True is not 1, while 1 and 1.0 are the same number."""
        stated, found = self.certificate, self.recomputed
        return isinstance(stated, bool) == isinstance(found, bool) and bool(stated == found)

    @property
    def difference(self) -> str:
        """By how much two numbers differ, relative to the certificate's."""
        stated, found = self.certificate, self.recomputed
        if self.same or not (_is_number(stated) and _is_number(found)):
            return ""
        return f"{(found - stated) / abs(stated):+.2e}" if stated else f"{found:+.3g} (absolute)"


def compare(group: str, certificate: Any, recomputed: Any, name: str = "") -> Iterator[Row]:  # noqa: ANN401  JSON
    """Every leaf of two JSON values; what only one of them has differs."""
    if isinstance(certificate, dict) and isinstance(recomputed, dict):
        for key in sorted(certificate.keys() | recomputed.keys()):
            yield from compare(
                group, certificate.get(key, ABSENT), recomputed.get(key, ABSENT), f"{name}.{key}".lstrip(".")
            )
    elif isinstance(certificate, list) and isinstance(recomputed, list):
        if len(certificate) != len(recomputed):
            yield Row(
                group=group,
                quantity=f"{name} count".strip(),
                certificate=len(certificate),
                recomputed=len(recomputed),
            )
        for index, (stated, found) in enumerate(zip(certificate, recomputed, strict=False)):
            yield from compare(group, stated, found, f"{name}[{index}]")
    else:
        yield Row(group=group, quantity=name, certificate=certificate, recomputed=recomputed)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
