"""Column types and defaults that every table shares."""

import secrets
import time
from datetime import UTC, datetime
from typing import Any, Literal

from sqlalchemy import DateTime, Dialect
from sqlalchemy.types import TypeDecorator

Prefix = Literal[
    "org",
    "key",
    "cam",
    "met",
    "pnl",
    "cmp",
    "roi",
    "rdg",
    "frm",
    "ext",
    "job",
    "cal",
    "pub",
    "msr",
    "prg",
    "prt",
    "ses",
    "rig",
    "man",
    "whk",
    "dlv",
    "crp",
]


def new_id(prefix: Prefix) -> str:
    """An opaque id that sorts by its time of birth, so that a list has a stable order and a cursor."""
    return f"{prefix}_{time.time_ns() // 1000:014x}{secrets.token_hex(8)}"


def utc_now() -> datetime:
    return datetime.now(UTC)


class UtcDateTime(TypeDecorator[datetime]):
    """An instant: aware and in UTC in Python, whatever the database keeps."""

    impl = DateTime(timezone=True)
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        if value is None:
            return None
        value = value.astimezone(UTC)
        # SQLite keeps text: without an offset, with microseconds, it sorts as time does
        return value.replace(tzinfo=None) if dialect.name == "sqlite" else value

    def process_result_value(self, value: Any | None, dialect: Dialect) -> datetime | None:  # noqa: ANN401
        if value is None:
            return None
        instant: datetime = value
        return instant.replace(tzinfo=UTC) if dialect.name == "sqlite" else instant.astimezone(UTC)
