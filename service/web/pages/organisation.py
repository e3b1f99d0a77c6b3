"""Pages of the own organisation: keys and sessions, audit trail, details."""

from fastapi import APIRouter, Response

from service.web.audit_words import ACTS
from service.web.rendering import SignedInPage

router = APIRouter(include_in_schema=False)


@router.get("/organisation")
def show_keys(page: SignedInPage) -> Response:
    return page.render("organisation/keys.html", title="Keys and sessions")


@router.get("/organisation/audit")
def show_audit(page: SignedInPage) -> Response:
    return page.render("organisation/audit.html", title="Audit trail", acts=ACTS)


@router.get("/organisation/details")
def show_details(page: SignedInPage) -> Response:
    return page.render("organisation/details.html", title="Organisation")
