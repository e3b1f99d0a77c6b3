"""Webhooks of an organisation, for its administrators."""

from urllib.parse import urlsplit

from fastapi import Response
from sqlalchemy import delete, func, select
from sqlalchemy.orm import Session

from radiometry.findings import interface
from service.auth import Admin
from service.changes import Reply, Writes
from service.context import Context, UsesContext
from service.lookup import Id, owned
from service.operations import Router
from service.paging import Page, UsesPaging
from service.problems import Problem, invalid, not_found
from service.routes import problems
from service.schemas.webhooks import DeliveryAnswer, NewWebhook, WebhookAnswer, WebhookChange
from store.audit import digest_value
from store.settings import derive_webhook_secret
from store.tables import Webhook, WebhookDelivery
from store.tables.base import new_id, utc_now
from store.webhooks import TEST

router = Router(prefix="/v1/webhooks", tags=["webhooks"])

_MOST = 20


@router.post("", status_code=201, response_model=WebhookAnswer, responses=problems(409))
def create_webhook(body: NewWebhook, caller: Admin, context: UsesContext, writing: Writes) -> Response:
    """Have events of your organisation sent to an address. The secret is in this answer and nowhere else.

    Each delivery is a POST with the headers of Standard Webhooks: `webhook-id`, `webhook-timestamp`, and
    `webhook-signature`, an HMAC-SHA256. Only public addresses are sent to, and no redirect is followed.
    """
    _check_host(context, body.url)

    def change(session: Session) -> Reply:
        owns = select(func.count()).where(Webhook.organisation_id == caller.organisation_id)
        if (session.scalar(owns) or 0) >= _MOST:
            raise Problem(interface.CONFLICT, f"Your organisation has {_MOST} webhooks. Remove one first.")
        hook_id = new_id("whk")
        secret = derive_webhook_secret(context.settings, hook_id)
        hook = Webhook(
            id=hook_id,
            organisation_id=caller.organisation_id,
            url=body.url,
            events=list(body.events),
            secret_sha256=digest_value(secret),
        )
        session.add(hook)
        session.flush()
        return Reply(status=201, body=WebhookAnswer.restate(hook, secret=secret))

    return writing.run(caller, change)


@router.get("", response_model=Page[WebhookAnswer], responses=problems())
def list_webhooks(paging: UsesPaging, caller: Admin, context: UsesContext) -> Response:
    """The webhooks of your organisation, without their secrets."""
    rows = select(Webhook).where(Webhook.organisation_id == caller.organisation_id)
    with context.database.reading() as session:
        return paging.send(session, rows, lambda found: [_answer(row) for row in found])


@router.patch("/{webhook_id}", response_model=WebhookAnswer, responses=problems(404))
def change_webhook(
    webhook_id: Id, body: WebhookChange, caller: Admin, context: UsesContext, writing: Writes
) -> Response:
    """Change the address or the events of a webhook, disable it, or enable it again.

    While it is disabled, events are not kept for it; what was queued before is sent once it is enabled.
    """
    if body.url is not None:
        _check_host(context, body.url)

    def change(session: Session) -> Reply:
        hook = owned(session, Webhook, webhook_id, caller)
        hook.url = body.url or hook.url
        hook.events = list(body.events or hook.events)
        if body.enabled is not None:
            hook.disabled_at = None if body.enabled else utc_now()
            hook.disabled_reason = None if body.enabled else "It was disabled by a key."
            hook.failing_since = None
        session.flush()
        return Reply(status=200, body=_answer(hook))

    return writing.run(caller, change)


@router.delete("/{webhook_id}", response_model=WebhookAnswer, responses=problems(404))
def remove_webhook(webhook_id: Id, caller: Admin, writing: Writes) -> Response:
    """Remove a webhook and its log of deliveries. The audit trail keeps that it was there."""

    def change(session: Session) -> Reply:
        hook = owned(session, Webhook, webhook_id, caller)
        session.execute(delete(WebhookDelivery).where(WebhookDelivery.webhook_id == hook.id))
        session.delete(hook)
        return Reply(status=200, body=_answer(hook))

    return writing.run(caller, change)


@router.get("/{webhook_id}/deliveries", response_model=Page[DeliveryAnswer], responses=problems(404))
def list_deliveries(webhook_id: Id, paging: UsesPaging, caller: Admin, context: UsesContext) -> Response:
    """The deliveries of a webhook, newest first, with the last answer of its address. Kept for 30 days."""
    with context.database.reading() as session:
        hook = owned(session, Webhook, webhook_id, caller)
        rows = select(WebhookDelivery).where(WebhookDelivery.webhook_id == hook.id)
        return paging.send(session, rows, lambda found: [_log(row) for row in found], newest_first=True)


@router.post(
    "/{webhook_id}/deliveries/{delivery_id}/retry",
    status_code=202,
    response_model=DeliveryAnswer,
    responses=problems(404, 409),
)
def retry_delivery(webhook_id: Id, delivery_id: Id, caller: Admin, writing: Writes) -> Response:
    """Send a delivery again at once, under the same `webhook-id`; if it fails, the attempts start over."""

    def change(session: Session) -> Reply:
        hook = owned(session, Webhook, webhook_id, caller)
        delivery = owned(session, WebhookDelivery, delivery_id, caller, for_update=True)
        if delivery.webhook_id != hook.id:
            raise not_found("delivery")
        _require_enabled(hook)
        delivery.state, delivery.ended_at = "queued", None
        delivery.attempts, delivery.due_at = 0, utc_now()
        session.flush()
        return Reply(status=202, body=_log(delivery))

    return writing.run(caller, change)


@router.post(
    "/{webhook_id}/test", status_code=202, response_model=DeliveryAnswer, responses=problems(404, 409)
)
def check_webhook(webhook_id: Id, caller: Admin, writing: Writes) -> Response:
    """Send an event `webhook.test`, and find in the log of deliveries what its address answered."""

    def change(session: Session) -> Reply:
        hook = owned(session, Webhook, webhook_id, caller)
        _require_enabled(hook)
        delivery = WebhookDelivery(webhook_id=hook.id, event=TEST, data={"webhook_id": hook.id})
        session.add(delivery)
        session.flush()
        return Reply(status=202, body=_log(delivery))

    return writing.run(caller, change)


def _require_enabled(hook: Webhook) -> None:
    if hook.disabled_at is not None:
        raise Problem(interface.CONFLICT, "This webhook is disabled. Enable it first.")


def _answer(hook: Webhook) -> WebhookAnswer:
    return WebhookAnswer.restate(hook)


def _log(row: WebhookDelivery) -> DeliveryAnswer:
    return DeliveryAnswer.restate(row, due_at=row.due_at if row.state == "queued" else None)


def _check_host(context: Context, url: str) -> None:
    parts = urlsplit(url)
    if parts.scheme != "https" and parts.hostname not in context.settings.private_webhook_hosts:
        message = "must begin with https, or name a host of STILB_WEBHOOK_HOSTS"
        raise invalid([{"type": "url", "loc": ("body", "url"), "msg": message}])
