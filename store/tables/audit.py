"""Audit trail: who changed what, when, from what to what. Append-only, held by triggers and hashes."""

from datetime import datetime

from sqlalchemy import CheckConstraint, Index, text
from sqlalchemy.orm import Mapped, mapped_column

from store.tables.base import Base, BigInt, Json, Sha256, index_some, utc_now

IN_SERIES = text("subject_type IN ('camera', 'measurement', 'publication', 'revocation')")
"""What a series shows changes with one of these; the condition as the index has it."""


class AuditEntry(Base):
    __table_args__ = (
        Index("ix_audit_entry_subject", "subject_id", "seq"),
        Index("ix_audit_entry_organisation", "organisation_id", "seq"),
        index_some("ix_audit_entry_series", "organisation_id", "subject_type", "seq", where=IN_SERIES),
    )

    seq: Mapped[BigInt] = mapped_column(
        primary_key=True,
        autoincrement=False,
        doc="Rises over all organisations: what lies between belongs to another one, or to nobody.",
    )
    organisation_id: Mapped[str | None]
    at: Mapped[datetime] = mapped_column(default=utc_now)
    actor: Mapped[str] = mapped_column(
        doc="A key's id, or the process that acted automatically: worker, sweeper, service."
    )
    action: Mapped[str]
    subject_type: Mapped[str]
    subject_id: Mapped[str]
    before: Mapped[Json]
    after: Mapped[Json]
    previous_sha256: Mapped[Sha256]
    sha256: Mapped[Sha256]  # over all above: edited, deleted, inserted or moved entries break the chain


class AuditChain(Base):
    """Last link of an organisation's chain, or, named "", of what belongs to none; who appends locks it."""

    name: Mapped[str] = mapped_column(primary_key=True)
    seq: Mapped[BigInt]
    sha256: Mapped[Sha256]


class AuditHead(Base):
    """The last link of the chain that all had in common in an older stilb, and that theirs continue."""

    __table_args__ = (CheckConstraint("id = 1", "one_row"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    seq: Mapped[BigInt]
    sha256: Mapped[Sha256]
