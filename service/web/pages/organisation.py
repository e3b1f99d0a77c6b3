"""Pages of the own organisation: keys and sessions, audit trail, details."""

from typing import get_args

from fastapi import APIRouter, Response

from service.web.audit_words import ACTS
from service.web.rendering import SignedInPage
from store.webhooks import EventName

router = APIRouter(include_in_schema=False)


@router.get("/organisation")
def show_keys(page: SignedInPage) -> Response:
    return page.render("organisation/keys.html", title="Keys and sessions")


@router.get("/organisation/audit")
def show_audit(page: SignedInPage) -> Response:
    return page.render("organisation/audit.html", title="Audit trail", acts=ACTS)


@router.get("/organisation/webhooks")
def show_webhooks(page: SignedInPage) -> Response:
    return page.render("organisation/webhooks.html", title="Webhooks", events=get_args(EventName))


@router.get("/organisation/details")
def show_details(page: SignedInPage) -> Response:
    return page.render("organisation/details.html", title="Organisation")
