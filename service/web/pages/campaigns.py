"""Campaigns: all of them, a new one, and one from its first file to its calibration."""

from typing import Any

from fastapi import APIRouter, Response

from radiometry import methods
from service.context import UsesContext
from service.lookup import Id, owned
from service.web.rendering import SignedInPage
from store.tables import Camera, Campaign

router = APIRouter(include_in_schema=False)


@router.get("/campaigns")
def show_campaigns(page: SignedInPage) -> Response:
    return page.render("campaigns.html", title="Campaigns")


# before the page of one campaign, whose id it would be taken for
@router.get("/campaigns/new")
def show_new_campaign(page: SignedInPage) -> Response:
    return page.render("campaign-new.html", title="New campaign", methods=_methods())


@router.get("/campaigns/{campaign_id}")
def show_campaign(campaign_id: Id, page: SignedInPage, context: UsesContext) -> Response:
    with context.database.reading() as session:
        campaign = owned(session, Campaign, campaign_id, page.caller)
        camera = session.get_one(Camera, campaign.camera_id)
    return page.render(
        "campaign.html",
        title=campaign.project_number or f"{campaign.method.capitalize()} of {camera.model}",
        campaign=campaign,
        camera=camera,
        room=_describe(campaign.method),
    )


def _methods() -> list[dict[str, Any]]:
    return [_describe(spec.name) for spec in methods.METHODS]


def _describe(method: str) -> dict[str, Any]:
    """What the pages must know of a method; its roles as a campaign meets them."""
    room = methods.get_method(method)
    return {
        "method": method,
        "roles": sorted(room.role_names | room.applied_role_names),
        "target": room.target is not None,
        "whole_frame": room.whole_frame,
        "finds_region": room.finds_region,
    }
