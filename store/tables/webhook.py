"""Tables of webhooks and of their deliveries, which are written with the change that they tell of."""

from datetime import datetime
from typing import ClassVar

from sqlalchemy import CheckConstraint, ForeignKey, Index
from sqlalchemy.orm import Mapped, mapped_column

from store.tables.base import Audited, Base, Json, UtcDateTime, new_id, utc_now


class Webhook(Audited, Base):
    """An address that is told of an organisation's events.

    Attributes
    ----------
    events : list of str
        Names of the events that it is told of.
    secret_sha256 : str
        Hash of the secret, as the audit trail has it; the secret itself follows from the installation's key.
    failing_since : datetime or None
        Since when no delivery has succeeded.
    disabled_at : datetime or None
        Nothing is sent from then on.
    disabled_reason : str or None
        Why, for a person.
    """

    __tablename__ = "webhook"
    __audit_without__: ClassVar[frozenset[str]] = frozenset({"failing_since"})

    id: Mapped[str] = mapped_column(primary_key=True, default=lambda: new_id("whk"))
    organisation_id: Mapped[str] = mapped_column(ForeignKey("organisation.id"), index=True)
    url: Mapped[str]
    events: Mapped[list[str]]
    secret_sha256: Mapped[str]
    created_at: Mapped[datetime] = mapped_column(UtcDateTime, default=utc_now)
    failing_since: Mapped[datetime | None] = mapped_column(UtcDateTime, default=None)
    disabled_at: Mapped[datetime | None] = mapped_column(UtcDateTime, default=None)
    disabled_reason: Mapped[str | None]


class WebhookDelivery(Base):
    """One event for one webhook: outbox and log.

    Attributes
    ----------
    id : str
        The header `webhook-id`, the same in every attempt.
    attempts : int
        How often it was sent.
    due_at : datetime
        Of a queued one: when it is sent next.
    status : int or None
        HTTP status of the last answer.
    error : str or None
        Why the last attempt failed.
    """

    __tablename__ = "webhook_delivery"
    __table_args__ = (
        CheckConstraint("state IN ('queued', 'delivered', 'failed')", "state_known"),
        Index("ix_webhook_delivery_state_due_at", "state", "due_at"),
        Index("ix_webhook_delivery_webhook_id_id", "webhook_id", "id"),
    )

    id: Mapped[str] = mapped_column(primary_key=True, default=lambda: new_id("dlv"))
    webhook_id: Mapped[str] = mapped_column(ForeignKey("webhook.id"))
    event: Mapped[str]
    data: Mapped[Json]
    state: Mapped[str] = mapped_column(default="queued")
    attempts: Mapped[int] = mapped_column(default=0)
    due_at: Mapped[datetime] = mapped_column(UtcDateTime, default=utc_now)
    status: Mapped[int | None]
    error: Mapped[str | None]
    created_at: Mapped[datetime] = mapped_column(UtcDateTime, default=utc_now)
    ended_at: Mapped[datetime | None] = mapped_column(UtcDateTime)
