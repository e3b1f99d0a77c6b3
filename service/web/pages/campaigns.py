"""Campaigns: all of them, a new one, and one from its first file to its calibration."""

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
    return page.render("campaign-new.html", title="New campaign")


@router.get("/campaigns/{campaign_id}")
def show_campaign(campaign_id: Id, page: SignedInPage, context: UsesContext) -> Response:
    with context.database.reading() as session:
        campaign = owned(session, Campaign, campaign_id, page.caller)
        camera = session.get_one(Camera, campaign.camera_id)
    spec = methods.get_method(campaign.method)
    return page.render(
        "campaign.html",
        title=campaign.project_number
        or f"{'Measuring night' if campaign.measures else spec.label} of {camera.model}",
        campaign=campaign,
        camera=camera,
        spec=spec,
    )
