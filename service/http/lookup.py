"""Look-up of a row by an id in an address: rows of other organisations do not exist for the caller."""

from collections.abc import Iterable, Sequence
from typing import Annotated, Any, Final, TypeVar

from fastapi import Path
from sqlalchemy.orm import Session
from sqlalchemy.orm.interfaces import ORMOption

from radiometry.records import Record
from service.http import auth, problems
from store.tables import Base, Campaign, FrameRow, Meter, Reading

Row = TypeVar("Row", bound=Base)

Id = Annotated[str, Path(description="An opaque id, as another answer gave it.", examples=["abc_1"])]


class Owned(Record, kw_only=False):
    """Marks a row of the caller's that a route takes: `frame` is that of `frame_id` in its address."""

    for_update: bool = False


Own = Annotated[Row, Owned()]
Locked = Annotated[Row, Owned(for_update=True)]

_WORDS: Final = {"api_key": "key", "purge": "recall", "web_session": "session"}
"""What answers call a row where that is not the name of its table."""


def owned(
    session: Session,
    table: type[Row],
    row_id: str,
    caller: auth.Caller,
    *,
    for_update: bool = False,
    options: Sequence[ORMOption] = (),
) -> Row:
    """Return the caller's row of this id, locked for a change; 404 otherwise. `options`: what is read."""
    row = _find(session, table, row_id, caller, with_for_update=for_update or None, options=options)
    if row is None:
        raise problems.not_found(_name(table))
    return row


def require_meters(session: Session, readings: Iterable[tuple[str | None, str]], caller: auth.Caller) -> None:
    """Refuse a meter of another kind than the quantity read: its certificate says nothing of that reading."""
    for meter_id, quantity in set(readings):
        if meter_id and (kind := owned(session, Meter, meter_id, caller).kind) != quantity:
            raise problems.wrong("meter_id", f"is that of a meter of {kind}; the reading is of {quantity}")


def is_own(annotation: Any) -> bool:  # noqa: ANN401  of a parameter
    return any(isinstance(each, Owned) for each in getattr(annotation, "__metadata__", ()))


def find_own(session: Session, stated: Any, row_id: str, caller: auth.Caller) -> Base:  # noqa: ANN401  an `Own`
    (how,) = stated.__metadata__
    row: Base = owned(session, stated.__origin__, row_id, caller, for_update=how.for_update)
    return row


def find_owned(session: Session, tables: Sequence[type[Base]], row_id: str, caller: auth.Caller) -> Base:
    for table in tables:
        if (row := _find(session, table, row_id, caller)) is not None:
            return row
    raise problems.not_found(" or ".join(_name(table) for table in tables))


def is_id(text: str) -> bool:
    """Return whether this may be an id: plain ASCII; PostgreSQL cannot even be asked for a NUL."""
    return text.isascii() and text.isprintable()


def _name(table: type[Base]) -> str:
    name: str = table.__tablename__
    return _WORDS.get(name, name)


def _find(session: Session, table: type[Row], row_id: str, caller: auth.Caller, **how: Any) -> Row | None:  # noqa: ANN401  SQLAlchemy's
    row = session.get(table, row_id, **how) if is_id(row_id) else None
    if row is None or _organisation_of(session, row) != caller.organisation_id:
        return None
    return row


def _organisation_of(session: Session, row: Base) -> str:
    if isinstance(row, FrameRow | Reading):
        return session.get_one(Campaign, row.campaign_id).organisation_id
    organisation_id: str = row.organisation_id  # type: ignore[attr-defined]
    return organisation_id
