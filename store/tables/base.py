"""The declarative base, column types, ids: constraint names are fixed, so that a migration can name them."""

import re
import secrets
import time
from datetime import UTC, datetime
from typing import Annotated, Any, ClassVar, get_args

from sqlalchemy import CheckConstraint, Dialect, ForeignKey, Index, MetaData, TextClause
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.orm import DeclarativeBase, Mapped, Session, declared_attr, mapped_column
from sqlalchemy.types import JSON, BigInteger, DateTime, String, TypeDecorator


def new_id(prefix: str) -> str:
    """An opaque id that sorts by its time of birth, so that a list has a stable order and a cursor."""
    return f"{prefix}_{time.time_ns() // 1000:014x}{secrets.token_hex(8)}"


def utc_now() -> datetime:
    return datetime.now(UTC)


def insert_or_not(session: Session, table: type) -> Any:  # noqa: ANN401  each database has its own
    """The database's own `insert`, which knows ON CONFLICT."""
    dialect = sqlite if session.get_bind().dialect.name == "sqlite" else postgresql
    return dialect.insert(table)


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


Json = dict[str, Any]
Sha256 = Annotated[str, mapped_column(String(64))]
BigInt = Annotated[int, mapped_column(BigInteger)]


class Base(DeclarativeBase):
    metadata = MetaData(
        naming_convention={
            "ix": "ix_%(column_0_N_label)s",
            "uq": "uq_%(table_name)s_%(column_0_N_name)s",
            "ck": "ck_%(table_name)s_%(constraint_name)s",
            "fk": "fk_%(table_name)s_%(column_0_N_name)s",
            "pk": "pk_%(table_name)s",
        }
    )
    type_annotation_map: ClassVar[dict[Any, Any]] = {
        Json: JSON,
        list[str]: JSON,
        list[Any]: JSON,
        str: String,
        datetime: UtcDateTime,
    }

    @declared_attr.directive
    def __tablename__(cls) -> str:  # noqa: N805  of the class
        """Return the class's own name in words, where it states no other; migrations know it."""
        return re.sub(r"(?<!^)(?=[A-Z])", "_", cls.__name__.removesuffix("Row")).lower()


def index_some(name: str, *columns: str, where: TextClause) -> Index:
    return Index(name, *columns, sqlite_where=where, postgresql_where=where)


def one_of(column: str, values: Any) -> CheckConstraint:  # noqa: ANN401  a Literal
    """Check that a column has one of the values of a Literal."""
    return CheckConstraint(f"{column} IN {get_args(values)}", f"{column}_known")


class Identified:
    """A table of opaque ids that begin with the ``prefix`` that its class states."""

    id: Mapped[str]

    def __init_subclass__(cls, prefix: str) -> None:
        cls.id = mapped_column(String, primary_key=True, default=lambda: new_id(prefix), sort_order=-1)
        super().__init_subclass__()


class Owned:
    organisation_id: Mapped[str] = mapped_column(ForeignKey("organisation.id"))


class Dated:
    created_at: Mapped[datetime] = mapped_column(default=utc_now)


class Audited:
    """A table whose every insert, change and deletion leaves an audit entry (store/audit.py)."""

    __audit_without__: ClassVar[frozenset[str]] = frozenset()  # what nobody decides: entries leave it out
    __audit_digests__: ClassVar[frozenset[str]] = frozenset()
    """Columns of which an entry holds the hash: secrets, and bulk that the row itself keeps."""


class AuditedTogether:
    """Rows that are parts of another and never change: one entry for all, with the hash of each."""
