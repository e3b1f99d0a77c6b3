"""Series: flat rows, read a page at a time by keyset; no connection is held between two pages."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, Protocol

from sqlalchemy import ColumnElement, literal, select, tuple_
from sqlalchemy.orm import Session

from store.tables import AuditEntry
from store.tables.audit import IN_SERIES

Page = list[str]
"""Some rows, at least one, as `store.ready.records` writes them."""
Key = list[Any]
"""Place of a row in the order of its series, as JSON has it."""

PAGE = 2000
"""Rows that are read at once."""
_ROWS = 250
"""Rows of a page: their cells stay in the processor's cache."""


@dataclass(frozen=True, kw_only=True)
class Asked:
    """Which rows of an organisation.

    Attributes
    ----------
    start, end : datetime or None
        Of coefficients the time in which they hold; of measurements the time at which the frame was taken.
    computed_start, computed_end : datetime or None
        When the version or the measurement was computed.
    """

    organisation_id: str
    camera_id: str | None = None
    campaign_id: str | None = None
    calibration_id: str | None = None
    method: str | None = None
    start: datetime | None = None
    end: datetime | None = None
    computed_start: datetime | None = None
    computed_end: datetime | None = None


class Series(Protocol):
    """Rows in a stable order."""

    def is_place(self, key: Key) -> bool:
        """Return whether a list from outside can be a place in this series."""

    def read_state(self, session: Session) -> str:
        """Return what changes whenever a row of the organisation is added or changes."""

    def find_end(self, session: Session, *, after: Key | None, limit: int) -> Key | None:
        """Return the place of the last row within the limit; None if no row follows it."""

    def read(self, *, after: Key | None, until: Key | None) -> Iterator[Page]:
        """Read the rows after one place up to another one."""


def cut(records: list[str]) -> Iterator[Page]:
    """Cut rows that were read into pages."""
    return (records[first : first + _ROWS] for first in range(0, len(records), _ROWS))


def match_equal(row: Any, asked: Asked, *names: str) -> Iterator[ColumnElement[bool]]:  # noqa: ANN401
    """Match the columns for which a value was asked."""
    for name in names:
        if getattr(asked, name) is not None:
            yield getattr(row, name) == getattr(asked, name)


def match_between(column: Any, start: datetime | None, end: datetime | None) -> list[ColumnElement[bool]]:  # noqa: ANN401
    """Match a time from one instant on and before another one, as far as they are given."""
    return [*([column >= start] if start else []), *([column < end] if end else [])]


def bind_place(values: Sequence[Any], key: Sequence[Any]) -> Any:  # noqa: ANN401
    """Return a place as the tuple that the columns of a key are compared with."""
    return tuple_(*(literal(value, each.type) for value, each in zip(values, key, strict=True)))


def is_plain(part: object) -> bool:
    """Return whether a part of a cursor is a text that can be asked for."""
    # PostgreSQL cannot even be asked for a NUL
    return isinstance(part, str) and part.isascii() and part.isprintable()


def is_instant(text: str) -> bool:
    """Return whether a text is an instant that a database holds."""
    try:
        return 1 < datetime.fromisoformat(text).astimezone(UTC).year < 9999
    except (ValueError, OverflowError):
        return False


def read_instant(text: str) -> datetime:
    """Read an instant of a cursor."""
    return datetime.fromisoformat(text).astimezone(UTC)


def read_state(session: Session, organisation_id: str, *subjects: str) -> str:
    """Return what changes with cameras, decisions and these subjects: the hash of each one's last entry."""
    entry = AuditEntry
    of_each = [
        select(entry.sha256)
        .where(entry.organisation_id == organisation_id, IN_SERIES, entry.subject_type == subject)
        .order_by(entry.seq.desc())
        .limit(1)
        .scalar_subquery()
        for subject in ("camera", "publication", "revocation", *subjects)
    ]
    return " ".join(each or "" for each in session.execute(select(*of_each)).one())
