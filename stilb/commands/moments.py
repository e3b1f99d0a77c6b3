"""Times on the command line."""

import re
from datetime import UTC, datetime
from typing import overload

from stilb.problem import Unclear

_DAY = re.compile(r"\d{4}-\d\d-\d\d")


def write_moment(text: str) -> str:
    """Return a time as short as `read_moment` takes it."""
    return text.removesuffix("T00:00:00Z")


@overload
def read_moment(text: str) -> str: ...
@overload
def read_moment(text: None) -> None: ...
def read_moment(text: str | None) -> str | None:
    """A day is its beginning in UTC, "now" is now; anything else is a time with its zone."""
    if text is None:
        return None
    if text == "now":
        return datetime.now(UTC).isoformat(timespec="seconds")
    if _DAY.fullmatch(text):
        return f"{text}T00:00:00Z"
    try:
        zoned = datetime.fromisoformat(text).tzinfo is not None
    except ValueError:
        zoned = False
    if not zoned:
        raise Unclear(
            f"{text!r} is not a time: give a day (2026-05-01), now, or a time with its zone "
            "(2026-05-01T20:30:00Z)"
        )
    return text
