"""Lists by keyset: stable while rows are added, and a page costs the same wherever it lies."""

import base64
import binascii
import json
from collections.abc import Callable, Sequence
from dataclasses import fields
from typing import Annotated, Any, Final, Generic, TypeVar

from fastapi import Depends, Query, Request
from fastapi.responses import JSONResponse
from pydantic import Field
from sqlalchemy import Select, inspect
from sqlalchemy.orm import Session

from radiometry.records import Record
from service.http import auth, connections, models, problems
from store.ready.series import is_text

AnswerType = TypeVar("AnswerType", bound=models.Answer)

Limit = Annotated[int, Query(ge=1, le=1000, description="How many items a page holds at most.")]
Cursor = Annotated[models.Text | None, Query(description="Taken from the `next` address of the page before.")]


_LARGEST_KEY = 2**63 - 1


def write_cursor(place: Sequence[object]) -> str:
    return base64.urlsafe_b64encode(json.dumps(place, separators=(",", ":")).encode()).decode().rstrip("=")


def read_cursor(text: str, is_place: Callable[[list[Any]], bool]) -> list[Any]:
    """Return the place that a cursor names; refuse one that this list has not given."""
    try:
        place = json.loads(base64.urlsafe_b64decode(text + "=" * (-len(text) % 4)))
        if isinstance(place, list) and is_place(place):
            return place
    except (binascii.Error, ValueError):
        pass
    raise problems.wrong("query.cursor", "is no cursor of this list: take it from `next`, or leave it out")


def read_key(cursor: str, table: str) -> Any:  # noqa: ANN401  a text, or the number of an entry
    """Return the key of a table's row after which a page begins."""

    def is_place(place: list[Any]) -> bool:
        named, *keys = place or [""]
        known = all(is_text(key) or (type(key) is int and 0 <= key <= _LARGEST_KEY) for key in keys)
        return named == table and len(keys) == 1 and known

    return read_cursor(cursor, is_place)[1]


class Page(models.Answer, Generic[AnswerType]):
    """One page of a list; `next` is the address of the page after it, or null at the end."""

    items: list[AnswerType]
    next: str | None = Field(json_schema_extra={"nullable_on_purpose": True})


class Paging(Record):
    """The page that a request asks for; a field that a list adds leaves the rows with exactly this value."""

    request: Request
    limit: Limit = 100
    cursor: Cursor = None

    def send_own(
        self,
        session: Session,
        caller: auth.Caller,
        rows: Select[Any],
        shape: Callable[[Any], models.Answer],
        *,
        newest_first: bool = False,
    ) -> JSONResponse:
        wanted = {name: getattr(self, name) for name in vars(self).keys() - _FIELDS_OF_PAGES}
        own = self.choose(caller, rows, **wanted)
        return self.send(session, own, lambda found: [*map(shape, found)], newest_first=newest_first)

    @staticmethod
    def choose(caller: auth.Caller, rows: Select[Any], **wanted: object) -> Select[Any]:
        """The organisation's rows with the values asked for; a bool asks whether `<name>_at` is set."""
        table = rows.column_descriptions[0]["entity"]
        rows = rows.where(table.organisation_id == caller.organisation_id)
        for name, value in wanted.items():
            column = getattr(table, name if hasattr(table, name) else f"{name}_at")
            if value is not None:
                rows = rows.where((column.is_not(None) if isinstance(value, bool) else column) == value)
        return rows

    def send(
        self,
        session: Session,
        rows: Select[Any],
        shape: Callable[[list[Any]], Sequence[models.Answer]],
        *,
        newest_first: bool = False,
    ) -> JSONResponse:
        """The rows after the cursor in the order of their key, and where the next ones are."""
        table = rows.column_descriptions[0]["entity"]
        (key,) = inspect(table).primary_key
        by, limit = getattr(table, key.key), self.limit
        if self.cursor is not None:
            after = read_key(self.cursor, table.__tablename__)
            rows = rows.where(by < after if newest_first else by > after)
        found = list(session.scalars(rows.order_by(by.desc() if newest_first else by).limit(limit + 1)))
        more = len(found) > limit
        address = None
        if more:
            cursor = write_cursor([table.__tablename__, getattr(found[limit - 1], by.key)])
            address = connections.address_with(self.request, cursor=cursor)
        return JSONResponse({"items": [item.dump() for item in shape(found[:limit])], "next": address})


_FIELDS_OF_PAGES: Final = frozenset(each.name for each in fields(Paging))

UsesPaging = Annotated[Paging, Depends()]
