"""Queries of the tables, by subject."""

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from typing import TypeVar

_R = TypeVar("_R")
_K = TypeVar("_K")


def group_by(rows: Iterable[_R], key: Callable[[_R], _K]) -> Mapping[_K, list[_R]]:
    """Return the rows by a key, in their order; of a key that none has there are none."""
    found: dict[_K, list[_R]] = defaultdict(list)
    for row in rows:
        found[key(row)].append(row)
    return found
