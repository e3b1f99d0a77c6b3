"""Values that an immutable object keeps once they were computed from it."""

from collections.abc import Callable
from functools import cached_property
from typing import Any, TypeVar

T = TypeVar("T")


class Keeping:
    """Base of a frozen dataclass: reviews of a campaign that grows meet the same frames again and again."""

    @cached_property
    def _kept(self) -> dict[str, tuple[object, Any]]:
        return {}

    def keep(self, name: str, given: object, compute: Callable[..., T], *args: object) -> T:
        """Return a result that was computed from this object and from `given`, computed once.

        Parameters
        ----------
        name : str
            Name of the result; the last one of each name is kept.
        given : object
            All else on which it depends, compared with ``==``.
        compute : callable
            Computes the result from `args`.
        """
        kept = self._kept.get(name)
        if kept is None or kept[0] != given:
            kept = self._kept[name] = given, compute(*args)
        found: T = kept[1]
        return found
