"""Times as people type them."""

import re
from datetime import UTC, datetime
from typing import overload

_DAY = re.compile(r"\d{4}-\d\d-\d\d")


@overload
def read_moment(text: str) -> str: ...
@overload
def read_moment(text: None) -> None: ...
def read_moment(text: str | None) -> str | None:
    """A day is its beginning in UTC, "now" is now; anything else goes as it is, for the service to read."""
    if text is None:
        return None
    if text == "now":
        return datetime.now(UTC).isoformat(timespec="seconds")
    return f"{text}T00:00:00Z" if _DAY.fullmatch(text) else text
