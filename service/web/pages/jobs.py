"""The queue, and what went wrong in it."""

from fastapi import APIRouter, Response

from service.web.rendering import SignedInPage

router = APIRouter(include_in_schema=False)


@router.get("/jobs")
def show_jobs(page: SignedInPage) -> Response:
    return page.render("jobs.html", title="Jobs")
