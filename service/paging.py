"""Lists by keyset: stable while rows are added, and a page costs the same wherever it lies."""

from collections.abc import Callable, Sequence
from typing import Annotated, Any, Generic, TypeVar

from fastapi import Depends, Query, Request
from fastapi.responses import JSONResponse
from pydantic import BaseModel, Field
from sqlalchemy import ColumnElement, Select, inspect, select
from sqlalchemy.orm import Session

from service.auth import Caller
from service.context import Context
from service.hosts import absolute
from service.schemas.base import Answer, Text

AnswerType = TypeVar("AnswerType", bound=Answer)

Limit = Annotated[int, Query(ge=1, le=1000, description="How many items a page holds at most.")]
Cursor = Annotated[Text | None, Query(description="Taken from the `next` address of the page before.")]


class Listing(BaseModel):
    """Which page of a list; a field that a list adds leaves only the rows with exactly this value."""

    limit: Limit = 100
    cursor: Cursor = None


class Page(Answer, Generic[AnswerType]):
    """One page of a list; `next` is the address of the page after it, or null at the end."""

    items: list[AnswerType]
    next: str | None = Field(json_schema_extra={"nullable_on_purpose": True})


class Paging:
    """The page that a request asks for."""

    def __init__(self, request: Request, limit: int = 100, cursor: str | int | None = None) -> None:
        self._request = request
        self._limit = limit
        self._cursor = cursor

    def send(
        self,
        session: Session,
        rows: Select[Any],
        shape: Callable[[list[Any]], Sequence[Answer]],
        *,
        newest_first: bool = False,
    ) -> JSONResponse:
        """The rows after the cursor in the order of their key, and where the next ones are."""
        table = rows.column_descriptions[0]["entity"]
        (key,) = inspect(table).primary_key
        by, limit = getattr(table, key.key), self._limit
        if self._cursor is not None:
            rows = rows.where(by < self._cursor if newest_first else by > self._cursor)
        found = list(session.scalars(rows.order_by(by.desc() if newest_first else by).limit(limit + 1)))
        more = len(found) > limit
        last = getattr(found[limit - 1], by.key) if more else None
        following = self._request.url.include_query_params(cursor=last)
        address = absolute(self._request, f"{following.path}?{following.query}") if more else None
        return JSONResponse({"items": [item.dump() for item in shape(found[:limit])], "next": address})


async def _read_paging(request: Request, limit: Limit = 100, cursor: Cursor = None) -> Paging:
    return Paging(request, limit, cursor)


UsesPaging = Annotated[Paging, Depends(_read_paging)]


def page_own(
    request: Request,
    context: Context,
    caller: Caller,
    table: Any,  # noqa: ANN401  a mapped class with an organisation
    listing: Listing,
    shape: Callable[[Any], Answer],
    *,
    where: ColumnElement[bool] | None = None,
) -> JSONResponse:
    """Return a page of the organisation's rows that have the values asked for, oldest first."""
    asked = listing.model_dump(exclude={"limit", "cursor"}, exclude_none=True)
    rows = select(table).where(table.organisation_id == caller.organisation_id).filter_by(**asked)
    rows = rows if where is None else rows.where(where)
    with context.database.reading() as session:
        return Paging(request, listing.limit, listing.cursor).send(
            session, rows, lambda found: [shape(row) for row in found]
        )
