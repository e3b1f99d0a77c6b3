"""Signatures and decisions other than publishing: the procedure's checklist, and recalls by cause."""

from datetime import datetime
from typing import Any

from sqlalchemy import CheckConstraint, ForeignKey, String
from sqlalchemy.orm import Mapped, mapped_column

from store.columns import UtcDateTime, new_id, utc_now
from store.tables.base import Audited, Base, Json


class ChecklistTick(Audited, Base):
    """An item of the procedure's checklist that somebody has ticked; unticking empties who and when."""

    __tablename__ = "checklist_tick"
    __table_args__ = (CheckConstraint("(done_by IS NULL) = (done_at IS NULL)", "who_and_when"),)

    campaign_id: Mapped[str] = mapped_column(ForeignKey("campaign.id"), primary_key=True)
    key: Mapped[str] = mapped_column(primary_key=True)
    done_by: Mapped[str | None]
    done_at: Mapped[datetime | None] = mapped_column(UtcDateTime)
    note: Mapped[str | None]


class ChecklistSignature(Audited, Base):
    """The operator's signature below a campaign's checklist."""

    __tablename__ = "checklist_signature"

    campaign_id: Mapped[str] = mapped_column(ForeignKey("campaign.id"), primary_key=True)
    name: Mapped[str]
    signed_by: Mapped[str]
    """The key that signed."""
    signed_at: Mapped[datetime] = mapped_column(UtcDateTime, default=utc_now)
    state_sha256: Mapped[str | None] = mapped_column(String(64))
    """Of the campaign's details, frames, readings and region as they were signed."""


class Recall(Audited, Base):
    """All versions made with something that turned out wrong: proposed, reviewed, revoked as one step."""

    __tablename__ = "purge"
    __table_args__ = (CheckConstraint("(confirmed_by IS NULL) = (confirmed_at IS NULL)", "who_and_when"),)

    id: Mapped[str] = mapped_column(primary_key=True, default=lambda: new_id("prg"))
    organisation_id: Mapped[str] = mapped_column(ForeignKey("organisation.id"), index=True)
    cause: Mapped[Json]
    reason: Mapped[str]
    calibration_ids: Mapped[list[Any]]
    """What the review saw: confirming revokes these and refuses when the cause has found others since."""
    created_by: Mapped[str]
    created_at: Mapped[datetime] = mapped_column(UtcDateTime, default=utc_now)
    confirmed_by: Mapped[str | None]
    confirmed_at: Mapped[datetime | None] = mapped_column(UtcDateTime)
