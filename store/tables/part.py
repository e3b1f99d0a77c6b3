"""The processes that make up the service, by their own word: a few rows, written every few seconds."""

from datetime import datetime

from sqlalchemy import CheckConstraint
from sqlalchemy.orm import Mapped, mapped_column

from store.columns import UtcDateTime, utc_now
from store.tables.base import Base, Json


class PartRow(Base):
    """One run of one process. Not audited: it records that somebody is there, and nobody's decision."""

    __tablename__ = "part"
    __table_args__ = (CheckConstraint("kind IN ('service', 'worker', 'sweeper')", "kind_known"),)

    id: Mapped[str] = mapped_column(primary_key=True)
    kind: Mapped[str]
    host: Mapped[str]
    pid: Mapped[int]
    started_at: Mapped[datetime] = mapped_column(UtcDateTime, default=utc_now)
    seen_at: Mapped[datetime] = mapped_column(UtcDateTime)
    """When the process last wrote this row."""
    worked_at: Mapped[datetime] = mapped_column(UtcDateTime)
    """When it last did its work, or was free to: the loop that does the work sets it."""
    details: Mapped[Json] = mapped_column(default=dict)
    counts: Mapped[Json | None] = mapped_column(default=None)
    """What the other processes of its kind must count with: shown to nobody."""
