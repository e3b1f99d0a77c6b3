"""The declarative base: constraint names are fixed on day 0, so that a migration can name them."""

from typing import Any, ClassVar

from sqlalchemy import JSON, MetaData, String
from sqlalchemy.orm import DeclarativeBase

Json = dict[str, Any]


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
    }


class Audited:
    """A table whose every insert, change and deletion leaves an audit entry (store/audit.py)."""

    __audit_without__: ClassVar[frozenset[str]] = frozenset()
    """Columns that an audit entry leaves out: what nobody decides."""
    __audit_digests__: ClassVar[frozenset[str]] = frozenset()
    """Columns of which an entry holds the hash: secrets, and bulk that the row itself keeps."""


class AuditedTogether:
    """Rows that are parts of another and never change: one entry for all, with the hash of each."""
