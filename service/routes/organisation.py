"""Your own organisation: how its certificates name it, and what it refuses."""

from typing import Any

from fastapi import APIRouter, Response
from sqlalchemy.orm import Session

from service.auth import Admin, Reader
from service.changes import Reply, Writes
from service.context import UsesContext
from service.routes import problems
from service.schemas.organisation import OrganisationChange, OwnOrganisationAnswer, UsageAnswer
from store.tables import Organisation
from store.usage import read_usage

router = APIRouter(prefix="/v1/organisation", tags=["keys"])


@router.get("", response_model=OwnOrganisationAnswer, responses=problems())
def get_organisation(caller: Reader, context: UsesContext) -> Any:  # noqa: ANN401
    """The organisation that your key belongs to, and what it uses of what it may."""
    with context.database.reading() as session:
        row = session.get_one(Organisation, caller.organisation_id)
        used = read_usage(session, row.id)
    usage = UsageAnswer.of(used, context.quotas, context.rates.used(row.id), context.settings)
    return OwnOrganisationAnswer.restate(row, usage=usage).respond()


@router.patch("", response_model=OwnOrganisationAnswer, responses=problems())
def change_organisation(body: OrganisationChange, caller: Admin, writing: Writes) -> Response:
    """Set the address on certificates ("" for none), and whether incomplete ones may be published."""

    def change(session: Session) -> Reply:
        organisation = session.get_one(Organisation, caller.organisation_id)
        for name, value in body.model_dump(exclude_unset=True).items():
            setattr(organisation, name, None if value == "" else value)
        session.flush()
        return Reply(status=200, body=OwnOrganisationAnswer.restate(organisation))

    return writing.run(caller, change)
