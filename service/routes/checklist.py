"""The procedure's checklist, which ticks itself where the record proves an item."""

from fastapi import Response
from sqlalchemy.orm import Session

from radiometry.findings import interface
from service.auth import Calibrator, Reader
from service.changes import Reply, Writes
from service.context import UsesContext
from service.lookup import Id, owned
from service.operations import Router
from service.problems import Problem, invalid
from service.routes import problems
from service.schemas.checklist import ChecklistAnswer, ChecklistChange, ItemChange, explain_missing_checklist
from store.queries.checklist import (
    KEYS,
    RecordState,
    has_checklist,
    hash_state,
    read_checklist,
    read_signature,
    set_tick,
    sign,
)
from store.tables import Campaign

router = Router(prefix="/v1/campaigns/{campaign_id}/checklist", tags=["checklist"])


@router.get("", response_model=ChecklistAnswer, responses=problems(404))
def get_checklist(campaign_id: Id, caller: Reader, context: UsesContext) -> Response:
    """The items of the printed checklist, who ticked each and from what it follows.

    Only the luminance procedure has one: of another method's campaign there are no items, and `said` says so.
    """
    with context.database.reading() as session:
        campaign = owned(session, Campaign, campaign_id, caller)
        return _answer(session, campaign, context.reviews.find(session, campaign_id).record).respond()


@router.patch("", response_model=ChecklistAnswer, responses=problems(404, 409))
def change_checklist(
    campaign_id: Id, body: ChecklistChange, caller: Calibrator, context: UsesContext, writing: Writes
) -> Response:
    """Tick items, take ticks away, sign. A signed list changes only together with a new signature."""

    def change(session: Session) -> Reply:
        campaign = owned(session, Campaign, campaign_id, caller)
        if not has_checklist(campaign):
            raise Problem(interface.NO_CHECKLIST, explain_missing_checklist(campaign))
        signature = read_signature(session, campaign)
        if signature is not None and body.signature is None:
            raise Problem(
                interface.CHECKLIST_SIGNED,
                f"{signature.name} has signed this checklist. Send a signature with the change: "
                "it then stands for the list as changed.",
            )
        for item in body.items or []:
            _refuse_undone(record, item)
            set_tick(session, campaign, item.key, done=item.done, note=item.note, by=caller.key_id)
        if body.signature is not None:
            sign(session, campaign, name=body.signature.name, by=caller.key_id)
        session.flush()
        return Reply(status=200, body=_answer(session, campaign, record))

    _refuse_unknown(body)
    with context.database.reading() as reading:
        owned(reading, Campaign, campaign_id, caller)
        record = context.reviews.find(reading, campaign_id).record
    return writing.run(caller, change)


def _refuse_undone(record: RecordState | None, item: ItemChange) -> None:
    finding = record.findings.get(item.key) if record else None
    if item.done and finding is not None and not finding.done:
        raise Problem(interface.STEP_NOT_DONE, f"{item.key}: {finding.sentence}")


def _refuse_unknown(body: ChecklistChange) -> None:
    unknown = [
        {
            "type": "unknown_key",
            "loc": ("body", "items", index, "key"),
            "msg": f"{item.key!r} is no item of the checklist; GET this address lists them",
        }
        for index, item in enumerate(body.items or [])
        if item.key not in KEYS
    ]
    if unknown:
        raise invalid(unknown)


def _answer(session: Session, campaign: Campaign, record: RecordState | None) -> ChecklistAnswer:
    items = read_checklist(session, campaign, record)
    signature = read_signature(session, campaign)
    state = hash_state(session, campaign) if signature else ""
    answer = ChecklistAnswer.of(campaign.id, items, signature, state)
    if has_checklist(campaign):
        return answer
    return answer.model_copy(update={"said": explain_missing_checklist(campaign)})
