"""Webhooks: addresses that are told of events, and the log of what they were sent."""

from typing import Annotated, Any, Literal
from urllib.parse import urlsplit

from pydantic import AfterValidator, Field, StringConstraints
from pydantic_core import PydanticCustomError

from service.messages import ADDRESS
from service.schemas.base import Answer, Flag, Form, Instant
from store.tables import Webhook, WebhookDelivery
from store.webhooks import EventName


def _check_url(url: str) -> str:
    try:
        parts = urlsplit(url)
        usable = parts.scheme in {"https", "http"} and bool(parts.hostname) and parts.port != 0
    except ValueError:
        usable = False
    if not usable or "@" in parts.netloc:
        raise PydanticCustomError(
            "url", "must be an address such as https://example.org/hook, without a login"
        )
    return url


Url = Annotated[
    str,
    StringConstraints(max_length=1000, pattern=ADDRESS),
    AfterValidator(_check_url),
    Field(
        description="https, without a login; http only for a host that the operator lists in "
        "STILB_WEBHOOK_HOSTS."
    ),
]
EventNames = Annotated[list[EventName], Field(min_length=1, max_length=20)]


class NewWebhook(Form):
    url: Url
    events: EventNames = Field(description="Of which the address is told.")


class WebhookChange(Form):
    url: Url | None = None
    events: EventNames | None = None
    enabled: Flag | None = Field(default=None, description="`true` enables one that was disabled.")


class WebhookAnswer(
    Answer,
    restates=Webhook,
    fields="id url events created_at failing_since disabled_at disabled_reason",
):
    secret: str | None = Field(
        default=None,
        description="Key of the signatures, `whsec_` and Base64: shown once, not to a repeated request.",
    )

    def keep(self) -> dict[str, Any]:
        return self.model_copy(update={"secret": None}).dump()


class DeliveryAnswer(
    Answer, restates=WebhookDelivery, fields="id event data attempts status error created_at ended_at"
):
    state: Literal["queued", "delivered", "failed"]
    due_at: Instant | None = Field(default=None, description="When a queued one is sent next.")
