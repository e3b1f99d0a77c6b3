"""Pages of the own organisation: keys and sessions, and its details."""

from fastapi import APIRouter, Response

from service.web.rendering import SignedInPage

router = APIRouter(include_in_schema=False)


@router.get("/organisation")
def show_keys(page: SignedInPage) -> Response:
    return page.render("organisation/keys.html", title="Keys and sessions")


@router.get("/organisation/details")
def show_details(page: SignedInPage) -> Response:
    return page.render("organisation/details.html", title="Organisation")
