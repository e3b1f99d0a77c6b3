"""Queries of the tables, by subject."""

from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Any, TypeVar

from sqlalchemy import ColumnElement, CursorResult, select, update
from sqlalchemy.orm import Session

_R = TypeVar("_R")
_K = TypeVar("_K")
_Row = TypeVar("_Row", bound=Any)


def group_by(rows: Iterable[_R], key: Callable[[_R], _K]) -> Mapping[_K, list[_R]]:
    """Return the rows by a key, in their order; of a key that none has there are none."""
    found: dict[_K, list[_R]] = defaultdict(list)
    for row in rows:
        found[key(row)].append(row)
    return found


def add(session: Session, row: _Row) -> _Row:
    """Add a row and write it, so that it has what the database gives it."""
    session.add(row)
    session.flush()
    return row


def by_id(session: Session, table: type[_Row], ids: Collection[str | None]) -> dict[str, _Row]:
    return {row.id: row for row in session.scalars(select(table).where(table.id.in_(ids)))}


def update_where(session: Session, table: Any, where: ColumnElement[bool], **values: Any) -> int:  # noqa: ANN401
    """Update rows of a table without loading them; return how many they were."""
    result = session.execute(update(table).where(where).values(**values))
    assert isinstance(result, CursorResult)  # noqa: S101  narrows the type: an UPDATE has a row count
    return result.rowcount
