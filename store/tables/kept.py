"""Results computed of a whole campaign, kept until it changes; derived, so never audited."""

from datetime import datetime
from typing import Any

from sqlalchemy import BigInteger, ForeignKey, Index, String, text
from sqlalchemy.orm import Mapped, mapped_column

from store.columns import UtcDateTime, utc_now
from store.tables.base import Base, Json

_IS_STALE = "kept_revision < revision"


class CampaignReview(Base):
    """List of what a campaign still lacks, and the revision of the campaign that it was computed from."""

    __tablename__ = "campaign_review"
    __table_args__ = (
        Index(
            "ix_campaign_review_stale",
            "not_before",
            sqlite_where=text(_IS_STALE),
            postgresql_where=text(_IS_STALE),
        ),
    )

    campaign_id: Mapped[str] = mapped_column(ForeignKey("campaign.id"), primary_key=True)
    revision: Mapped[int] = mapped_column(BigInteger, default=0)
    """Rises in every transaction that changes what the review depends on (store/revisions.py)."""
    whole_revision: Mapped[int] = mapped_column(BigInteger, default=0)
    """Last one at which any of its frames may have changed: that of the campaign itself."""
    kept_revision: Mapped[int] = mapped_column(BigInteger, default=-1)
    """Revision that the rest of this row and the verdicts were computed from."""
    kept_by: Mapped[str | None]
    """Hash of the code that computed them: another code computes them again."""
    not_before: Mapped[datetime | None] = mapped_column(UtcDateTime)
    """No worker begins before: one computes them, or has just done so and it took long."""
    missing: Mapped[list[Any] | None] = mapped_column(default=None)
    advice: Mapped[list[Any] | None] = mapped_column(default=None)
    gaps: Mapped[list[Any] | None] = mapped_column(default=None)
    findings: Mapped[list[Any] | None] = mapped_column(default=None)
    checklist: Mapped[Json | None] = mapped_column(default=None)
    """What the record says of each item, and since when each part of the record is as it is."""


class FrameVerdict(Base):
    """Reasons of the verdict on one frame, from the same revision; a frame that passes has no row."""

    __tablename__ = "frame_verdict"

    # no foreign keys: checking one takes a lock on the frame, whose own writer waits for the review's row
    frame_id: Mapped[str] = mapped_column(primary_key=True)
    campaign_id: Mapped[str] = mapped_column(index=True)
    reasons: Mapped[str]
    """JSON: code, outcome and detail of each."""


class FrameChange(Base):
    """Revision of the campaign at which a frame, its statistics or the verdict on it last changed."""

    __tablename__ = "frame_change"
    __table_args__ = (Index("ix_frame_change_campaign_id_revision", "campaign_id", "revision"),)

    # no foreign keys, as for its verdict
    frame_id: Mapped[str] = mapped_column(primary_key=True)
    campaign_id: Mapped[str]
    revision: Mapped[int] = mapped_column(BigInteger)


class SmallPreview(Base):
    """A frame's preview at the size of a grid's cell."""

    __tablename__ = "small_preview"

    # no foreign key: it is kept before the frame that shows it, and holds nothing that its preview does not
    preview_sha256: Mapped[str] = mapped_column(String(64), primary_key=True)
    webp: Mapped[bytes]


class Rendering(Base):
    """A certificate, a report or a version's plot as it was rendered: the same content is rendered once."""

    __tablename__ = "rendering"

    source_sha256: Mapped[str] = mapped_column(String(64), primary_key=True)
    """Of all that goes in, and of how it is rendered."""
    sha256: Mapped[str] = mapped_column(ForeignKey("blob.sha256"))
    created_at: Mapped[datetime] = mapped_column(UtcDateTime, default=utc_now)
