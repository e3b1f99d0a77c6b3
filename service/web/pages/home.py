"""The first page: a card to start with, and what needs attention."""

from fastapi import APIRouter, Response

from service.web.rendering import SignedInPage

router = APIRouter(include_in_schema=False)


@router.get("/")
def show_home(page: SignedInPage) -> Response:
    return page.render("home.html", title="Start")
