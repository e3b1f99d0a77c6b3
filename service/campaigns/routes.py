"""Campaigns, their region and their checklist."""

from typing import Annotated, Any

from fastapi import Depends, Query, Response
from pydantic import ConfigDict, Field, Strict, ValidationError
from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry import findings, methods
from radiometry.frame.multispectral import name_panel
from radiometry.specification.roles import FIELD
from service.campaigns import schemas
from service.equipment.schemas import PanelOffered
from service.http import answers, operations, paging
from service.http.auth import Calibrator, Reader
from service.http.changes import Reply, Writes
from service.http.context import UsesContext
from service.http.lookup import Id, Own, owned
from service.http.models import Answer, Form, LongText, Text, maybe, rfc3339, told
from service.http.problems import Problem, invalid, located, refuse, wrong
from service.measurements.requests import NewDrawing
from store import codec, reviews
from store.queries import add, campaigns, checklist, organisations
from store.queries.evidence import Offer, find_by_serial, find_offer
from store.tables import Calibration, Camera, Campaign, ChecklistSignature, FrameRow, Panel, Roi, base
from store.tables.campaign import CampaignKind


class ItemChange(Form):
    key: Text = told("One of the items that the campaign's checklist lists.")
    done: Annotated[bool, Strict()] = told("false takes the tick away.")
    note: LongText | None = maybe("What was done, and with which equipment; recorded with the item.")


class NewSignature(Form):
    name: Text = told("The operator's name, as signed below the printed checklist.")


class ChecklistChange(Form):
    """Ticks to set or to take away, a signature, or both."""

    model_config = ConfigDict(
        json_schema_extra={"anyOf": [{"required": ["items"]}, {"required": ["signature"]}]}
    )

    items: Annotated[list[ItemChange] | None, Field(min_length=1, max_length=1000)] = None
    signature: NewSignature | None = None

    def check(self) -> None:
        if self.items is None and self.signature is None:
            raise ValueError("give items, a signature, or both")


class ItemAnswer(Answer, restates=checklist.ChecklistItem):
    pass


class SignatureAnswer(Answer, restates=ChecklistSignature, fields="name signed_by signed_at state_sha256"):
    changed: bool = told(
        "Whether details, frames, readings, region or ticks are other than when it was signed."
    )


class ChecklistAnswer(Answer):
    campaign_id: str
    done: int
    open: int
    items: list[ItemAnswer]
    signature: SignatureAnswer | None = None
    said: str | None = maybe("Why there are no items, where there are none.")


def explain_missing_checklist(campaign: Campaign) -> str:
    kind = "night of measurements" if campaign.measures else f"{campaign.method} campaign"
    return f"The printed checklist is that of the luminance procedure; a {kind} has none."


router = operations.Router(prefix="/v1/campaigns", tags=["campaigns"])


@router.post("", status_code=201, response_model=schemas.CampaignAnswer, responses=answers.problems(404))
def create_campaign(body: schemas.NewCampaign, caller: Calibrator, session: Session) -> Reply:
    """Begin a campaign: one camera, one method, and a set of readings or a night of measurements."""
    owned(session, Camera, body.camera_id, caller)
    if body.panel_id is not None:
        owned(session, Panel, body.panel_id, caller)
    _check_stated(body.method, body)
    kind = body.kind or "calibration"
    if kind == "measurement":
        _require_measurable(body.method)
    values = body.model_dump(exclude={"panel_serial"}) | {"kind": kind}
    values["target"] = _read_target(body.method, body.target)
    campaign = Campaign(organisation_id=caller.organisation_id, **values)
    _require_order(campaign)
    _choose_panel(session, campaign, body.panel_serial, offer=None)
    return Reply(status=201, body=schemas.CampaignAnswer.restate(add(session, campaign)))


class CampaignListing(paging.Paging):
    archived: Annotated[bool | None, Query(description="Only those put away, or only the others.")] = None
    project_number: Text | None = None
    camera_id: Text | None = None
    method: Text | None = None
    kind: CampaignKind | None = None


@router.get("", response_model=paging.Page[schemas.CampaignAnswer])
def list_campaigns(
    listing: Annotated[CampaignListing, Depends()], caller: Reader, session: Session
) -> Response:
    """The campaigns of your organisation, oldest first."""
    return listing.send_own(session, caller, select(Campaign), schemas.CampaignAnswer.restate)


@router.get("/{campaign_id}", response_model=schemas.CampaignAnswer)
def get_campaign(campaign: Own[Campaign], context: UsesContext, session: Session) -> Response:
    """One campaign, with what has arrived and what a fit, and a good one, still needs."""
    return _whole(session, campaign, context.reviews.find(session, campaign.id)).respond()


@router.patch("/{campaign_id}", response_model=schemas.CampaignAnswer, responses=answers.problems(409))
def change_campaign(
    campaign: Own[Campaign], body: schemas.CampaignChange, caller: Calibrator, session: Session
) -> Reply:
    """Correct what is written on a campaign."""
    if body.panel_id is not None:
        owned(session, Panel, body.panel_id, caller)
    _check_stated(campaign.method, body)
    if body.kind == "measurement" and not campaign.measures:
        _require_no_calibration(session, campaign)
    values = body.model_dump(exclude_unset=True, exclude={"panel_serial", "archived"})
    values = {name: None if value == "" else value for name, value in values.items()}
    jobs = []
    if body.archived is not None:
        campaign.archived_at = (campaign.archived_at or base.utc_now()) if body.archived else None
    if body.camera_id is not None and body.camera_id != campaign.camera_id:
        owned(session, Camera, body.camera_id, caller)
        jobs = campaigns.check_again(session, campaign, by=caller.key_id)
    if body.target is not None:
        values["target"] = _read_target(campaign.method, body.target)
        jobs = campaigns.renew_extractions(session, campaign, by=caller.key_id)
    for name, value in values.items():
        setattr(campaign, name, value)
    _require_order(campaign)
    if body.panel_serial is not None:
        _choose_panel(session, campaign, body.panel_serial, offer=find_offer(session, campaign))
    session.flush()
    return Reply(status=200, body=_whole(session, campaign, reviews.assess(session, campaign)), jobs=jobs)


@router.put("/{campaign_id}/roi", response_model=schemas.RoiAnswer)
def set_campaign_roi(
    campaign: Own[Campaign], drawing: NewDrawing, caller: Calibrator, session: Session
) -> Reply:
    """Set the region of every frame that has none of its own; older statistics stay."""
    roi = campaigns.find_or_add_roi(session, caller.organisation_id, drawing)
    jobs = campaigns.set_roi(session, campaign, roi, by=caller.key_id)
    return Reply(status=200, body=schemas.RoiAnswer.of(roi), jobs=jobs)


@router.get("/{campaign_id}/roi", response_model=schemas.RoiAnswer)
def get_campaign_roi(campaign: Own[Campaign], session: Session) -> Response:
    """The region in use."""
    if campaign.roi_id is None:
        raise Problem(findings.interface.NOT_FOUND, "This campaign has no region yet: PUT one here.")
    return schemas.RoiAnswer.of(session.get_one(Roi, campaign.roi_id)).respond()


def _choose_panel(session: Session, campaign: Campaign, serial: str | None, *, offer: Offer | None) -> None:
    """Name the registered panel of a serial number, or register the offered one as its files state it."""
    if serial is None:
        return
    panel = find_by_serial(session, campaign.organisation_id, serial)
    if panel is None and offer is not None and offer.serial == name_panel(serial) and offer.bands:
        values = {"serial": offer.serial, "measured_on": offer.stated_on, "bands": offer.bands}
        panel, _ = organisations.find_or_add_panel(session, campaign.organisation_id, values)
    if panel is None:
        message = "is not registered, and no frame of this campaign states what it reflects: register it"
        raise wrong("body.panel_serial", message)
    campaign.panel_id = panel.id


def _check_stated(method: str, body: schemas.CampaignDetails) -> None:
    """Refuse what belongs to the fit of another method, and a lamp or response that cannot be read."""
    spec = methods.get_method(method)
    stated = body.model_dump(include=set(schemas.STATED), exclude_unset=True)
    fields = {each.name: each.field for each in spec.parameters if each.given_by == "campaign"}
    foreign = stated.keys() - fields.keys()
    refuse((f"body.{name}", f"is not a part of a {method} campaign") for name in foreign)
    if stated:
        codec.decode(spec.params, {fields[name]: value for name, value in stated.items()})


def _require_order(campaign: Campaign) -> None:
    if campaign.started_at and campaign.ended_at and campaign.ended_at < campaign.started_at:
        message = f"is before the beginning of the campaign, {rfc3339(campaign.started_at)}"
        raise wrong("body.ended_at", message)


def _require_measurable(method: str) -> None:
    if methods.get_method(method).application is None:
        able = ", ".join(spec.name for spec in methods.METHODS if spec.application)
        raise wrong("body.method", f"nothing is measured with a {method} calibration: name one of {able}")


def _require_no_calibration(session: Session, campaign: Campaign) -> None:
    """Refuse a campaign with versions, or with frames of a calibration, withdrawn ones too."""
    _require_measurable(campaign.method)
    others = select(FrameRow.filename).where(FrameRow.campaign_id == campaign.id, FrameRow.role != FIELD.name)
    fitted = select(Calibration.id).where(Calibration.campaign_id == campaign.id)
    if (other := session.scalar(others.limit(1))) is not None or session.scalar(fitted.limit(1)) is not None:
        has = (
            f"the frame {other}, which is not a field frame" if other else "a version that was fitted from it"
        )
        detail = f"This campaign has {has}: create another one for the night, and send its frames there."
        raise Problem(findings.interface.CONFLICT, detail)


def _read_target(method: str, said: dict[str, Any] | None) -> dict[str, Any] | None:
    """Read the target as the method requires it, defaults written out; None if it is stated later."""
    if (kind := methods.get_method(method).target) is None and said is None:
        return None
    if kind is None:
        message = f"a {method} campaign photographs nothing that must be described: leave it out"
        raise wrong("body.target", message)
    try:
        return codec.read_strictly(kind, said or {})
    except ValidationError as error:
        if said is None:
            return None
        raise invalid(located(error, "body", "target")) from error


def _whole(session: Session, campaign: Campaign, readiness: reviews.Assessment) -> schemas.CampaignAnswer:
    counts = campaigns.count(session, campaign)
    offer = find_offer(session, campaign)
    lone = [each for each in readiness.findings if each.code == findings.shared.READING_WITHOUT_FRAMES]
    return schemas.CampaignAnswer.restate(
        campaign,
        frames=counts,
        missing=[sentence for each in readiness.missing for sentence in each.sentences],
        advice=[sentence for each in readiness.advice for sentence in each.sentences],
        causes=[*readiness.missing, *lone, *readiness.advice],
        findings=readiness.findings,
        readings=counts.readings,
        measured=campaigns.count_measured(session, campaign) if campaign.measures else None,
        panel_offered=PanelOffered.restate(offer) if offer else None,
    )


checklist_router = operations.Router(prefix="/v1/campaigns/{campaign_id}/checklist", tags=["checklist"])


@checklist_router.get("", response_model=ChecklistAnswer, responses=answers.problems(404))
def get_checklist(campaign: Own[Campaign], context: UsesContext, session: Session) -> Response:
    """The items of the printed checklist, who ticked each and from what it follows.

    Only the luminance procedure has one: of another method's campaign there are no items, and `said` says so.
    """
    return _answer(session, campaign, context.reviews.find(session, campaign.id).record).respond()


@checklist_router.patch("", response_model=ChecklistAnswer, responses=answers.problems(404, 409))
def change_checklist(
    campaign_id: Id, body: ChecklistChange, caller: Calibrator, context: UsesContext, writing: Writes
) -> Response:
    """Tick items, take ticks away, sign. A signed list changes only together with a new signature."""

    def change(session: Session) -> Reply:
        campaign = owned(session, Campaign, campaign_id, caller)
        if not checklist.has_checklist(campaign):
            raise Problem(findings.interface.NO_CHECKLIST, explain_missing_checklist(campaign))
        if (signature := checklist.read_signature(session, campaign)) is not None and body.signature is None:
            raise Problem(
                findings.interface.CHECKLIST_SIGNED,
                f"{signature.name} has signed this checklist. Send a signature with the change: "
                "it then stands for the list as changed.",
            )
        for item in body.items or []:
            finding = record.findings.get(item.key) if record else None
            if item.done and finding is not None and not finding.done:
                raise Problem(findings.interface.STEP_NOT_DONE, f"{item.key}: {finding.sentence}")
            checklist.set_tick(session, campaign, item.key, done=item.done, note=item.note, by=caller.key_id)
        if body.signature is not None:
            checklist.sign(session, campaign, name=body.signature.name, by=caller.key_id)
        session.flush()
        return Reply(status=200, body=_answer(session, campaign, record))

    refuse(
        (f"body.items.{index}.key", f"{item.key!r} is no item of the checklist; GET this address lists them")
        for index, item in enumerate(body.items or ())
        if item.key not in checklist.KEYS
    )
    with context.database.reading() as reading:
        owned(reading, Campaign, campaign_id, caller)
        record = context.reviews.find(reading, campaign_id).record
    return writing.run(caller, change)


def _answer(session: Session, campaign: Campaign, record: checklist.RecordState | None) -> ChecklistAnswer:
    items = checklist.read_checklist(session, campaign, record)
    done = sum(item.done_by is not None for item in items)
    signed = None
    if (signature := checklist.read_signature(session, campaign)) is not None:
        state = checklist.hash_state(session, campaign)
        signed = SignatureAnswer.restate(signature, changed=signature.state_sha256 not in {None, state})
    return ChecklistAnswer.restate(
        campaign_id=campaign.id,
        done=done,
        open=len(items) - done,
        items=items,
        signature=signed,
        said=None if checklist.has_checklist(campaign) else explain_missing_checklist(campaign),
    )
