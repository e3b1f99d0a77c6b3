"""Tables of manifests of cards, and of the public keys that receipts were signed with."""

from datetime import datetime
from typing import Any, ClassVar

from sqlalchemy import ForeignKey, Index, String, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from store.columns import UtcDateTime, new_id, utc_now
from store.tables.base import Audited, Base


class Manifest(Audited, Base):
    """Contents of a card, as the sender lists them; never changed."""

    __tablename__ = "manifest"
    __audit_digests__: ClassVar[frozenset[str]] = frozenset({"files", "others"})
    __table_args__ = (
        UniqueConstraint("campaign_id", "sha256"),
        Index("ix_manifest_campaign_id_id", "campaign_id", "id"),
    )

    id: Mapped[str] = mapped_column(primary_key=True, default=lambda: new_id("man"))
    organisation_id: Mapped[str] = mapped_column(ForeignKey("organisation.id"))
    campaign_id: Mapped[str] = mapped_column(ForeignKey("campaign.id"))
    sha256: Mapped[str] = mapped_column(String(64))
    """Of both lists in canonical JSON: the same card is the same manifest."""
    files: Mapped[list[Any]]
    others: Mapped[list[Any]]
    """Files of the card that are not sent."""
    created_at: Mapped[datetime] = mapped_column(UtcDateTime, default=utc_now)


class SigningKey(Audited, Base):
    """A public key of this service; none is ever removed, so that old receipts can be verified."""

    __tablename__ = "signing_key"

    id: Mapped[str] = mapped_column(primary_key=True)
    public_key: Mapped[str]
    """PEM."""
    created_at: Mapped[datetime] = mapped_column(UtcDateTime, default=utc_now)
