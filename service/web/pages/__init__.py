"""One file a page, or a few that belong together: from an address to a template, and nothing else."""

from fastapi import FastAPI

from service.web import assets
from service.web.pages import (
    calibrations,
    cameras,
    campaigns,
    documents,
    home,
    jobs,
    measurements,
    organisation,
    rigs,
    sign_in,
    tools,
)


def include_pages(app: FastAPI) -> None:
    """Hang every page into the application."""
    for module in (
        assets,
        sign_in,
        documents,
        home,
        cameras,
        rigs,
        campaigns,
        calibrations,
        measurements,
        jobs,
        organisation,
        tools,
    ):
        app.include_router(module.router)
