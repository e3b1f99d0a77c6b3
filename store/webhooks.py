"""Events for webhooks: each is a row of the outbox, in the transaction of what it tells of."""

from datetime import timedelta
from typing import Any, Final, Literal

from sqlalchemy import CursorResult, delete, func, or_, select, update
from sqlalchemy.orm import Session

from store.tables import Calibration, Webhook, WebhookDelivery
from store.tables.base import utc_now

EventName = Literal[
    "calibration.created",
    "calibration.published",
    "calibration.revoked",
    "job.succeeded",
    "job.failed",
    "job.quarantined",
]
TEST: Final = "webhook.test"
PAUSES: Final = tuple(
    timedelta(seconds=seconds) for seconds in (5, 60, 300, 1800, 7200, 18_000, 36_000, 50_400, 72_000)
)
"""Between the attempts: nine pauses, 52 hours together."""
DISABLED_AFTER: Final = timedelta(days=5)
_KEPT_FOR: Final = timedelta(days=30)
_LEASE: Final = timedelta(minutes=2)
"""How long another process leaves a delivery alone that is being sent."""
_GONE: Final = 410


def announce(session: Session, organisation_id: str, event: EventName, data: dict[str, Any]) -> None:
    """Queue an event for the organisation's webhooks that want it."""
    hooks = select(Webhook).where(Webhook.organisation_id == organisation_id, Webhook.disabled_at.is_(None))
    session.add_all(
        WebhookDelivery(webhook_id=hook.id, event=event, data=data)
        for hook in session.scalars(hooks)
        if event in hook.events
    )


def describe_version(calibration: Calibration) -> dict[str, Any]:
    """Return what an event says of a version; the rest is asked for with a key."""
    return {
        "calibration_id": calibration.id,
        "campaign_id": calibration.campaign_id,
        "camera_id": calibration.camera_id,
        "method": calibration.method,
        "version": calibration.version,
    }


def is_any_due(session: Session) -> bool:
    """Return True if a delivery is to be sent."""
    due = (WebhookDelivery.state == "queued") & (WebhookDelivery.due_at <= utc_now())
    return session.scalar(select(WebhookDelivery.id).where(due).limit(1)) is not None


def claim_due(session: Session, *, without: set[str], limit: int) -> list[tuple[WebhookDelivery, Webhook]]:
    """Take the oldest due delivery of each webhook but those at work: a slow one holds up itself alone."""
    now = utc_now()
    due = (WebhookDelivery.state == "queued") & (WebhookDelivery.due_at <= now)
    first = (
        select(func.min(WebhookDelivery.id))
        .join(Webhook, Webhook.id == WebhookDelivery.webhook_id)
        .where(due, Webhook.disabled_at.is_(None), Webhook.id.not_in(without))
        .group_by(WebhookDelivery.webhook_id)
        # the longest due first: eight slow ones would else come before all others, always
        .order_by(func.min(WebhookDelivery.due_at))
        .limit(limit)
    )
    claimed = []
    for delivery_id in session.scalars(first).all():
        mine = update(WebhookDelivery).where(WebhookDelivery.id == delivery_id, due)
        taken = session.execute(mine.values(due_at=now + _LEASE, attempts=WebhookDelivery.attempts + 1))
        if isinstance(taken, CursorResult) and taken.rowcount:
            delivery = session.get_one(WebhookDelivery, delivery_id, populate_existing=True)
            claimed.append((delivery, session.get_one(Webhook, delivery.webhook_id)))
    return claimed


def mend_due(session: Session) -> None:
    """Send what was queued before the clock was set back, and would wait longer than any rule says."""
    now, count = utc_now(), WebhookDelivery.attempts
    late = or_(
        *(
            (count == attempts) & (WebhookDelivery.due_at > now + max(pause, _LEASE))
            for attempts, pause in enumerate((timedelta(0), *PAUSES))
        )
    )
    session.execute(update(WebhookDelivery).where(WebhookDelivery.state == "queued", late).values(due_at=now))


def note_outcome(session: Session, delivery_id: str, *, status: int | None, error: str | None) -> None:
    """Note how an attempt ended: done, to be tried again, or given up; and disable what fails for days."""
    delivery = session.get(WebhookDelivery, delivery_id)
    if delivery is None:  # its webhook was removed meanwhile
        return
    hook = session.get_one(Webhook, delivery.webhook_id)
    now = utc_now()
    delivery.status, delivery.error = status, error
    if error is None:
        delivery.state, delivery.ended_at, hook.failing_since = "delivered", now, None
        return
    hook.failing_since = hook.failing_since or now
    if delivery.attempts > len(PAUSES):
        delivery.state, delivery.ended_at = "failed", now
    else:
        delivery.due_at = now + PAUSES[delivery.attempts - 1]
    if status == _GONE:
        hook.disabled_at, hook.disabled_reason = now, "Its address answered 410 Gone."
    elif now - hook.failing_since >= DISABLED_AFTER:
        hook.disabled_at = now
        hook.disabled_reason = f"No delivery succeeded for {DISABLED_AFTER.days} days. Last: {error}"


def forget_old(session: Session) -> None:
    """Delete deliveries that ended a month ago."""
    old = delete(WebhookDelivery).where(WebhookDelivery.state != "queued")
    session.execute(old.where(WebhookDelivery.ended_at < utc_now() - _KEPT_FOR))
