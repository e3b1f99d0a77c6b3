"""Your own organisation: how its certificates name it, and what it refuses."""

from typing import Any

from fastapi import Response
from pydantic import Field
from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.findings import interface
from service.auth import Admin, Reader
from service.changes import Reply, Writes
from service.context import UsesContext
from service.operations import Router
from service.problems import Problem
from service.routes import problems
from service.schemas.base import Answer, ClearableLong, ClearableZone, Form, Text
from store.queries.usage import Quotas, Used, read_usage
from store.settings import Settings
from store.tables import Organisation


class OrganisationChange(Form):
    name: Text | None = Field(default=None, description="Of your laboratory, as certificates print it.")
    address: ClearableLong | None = Field(
        default=None, description="Of your laboratory, as certificates print it."
    )
    refuses_incomplete_certificates: bool | None = Field(
        default=None,
        description="Publishing answers 409 `certificate_incomplete` while a certificate has gaps.",
        strict=True,
    )
    time_zone: ClearableZone | None = Field(
        default=None,
        description="Of the clocks of your cameras, for files that state no offset and campaigns that state "
        "no other: an IANA name or an offset. Files of Parrot and MicaSense cameras are in UTC.",
    )


def require_free_name(session: Session, name: str, *, but: str = "") -> None:
    """Refuse a name that another organisation has."""
    taken = select(Organisation.id).where(Organisation.name == name, Organisation.id != but)
    if session.scalar(taken) is not None:
        raise Problem(interface.CONFLICT, f"The organisation {name!r} exists already.")


class UsageAnswer(Answer):
    """Usage of an organisation; a limit that is absent is none."""

    frames: int
    frames_limit: int | None = None
    stored_bytes: int = Field(description="Of the files of its frames.")
    stored_bytes_limit: int | None = None
    jobs_waiting: int
    jobs_waiting_limit: int | None = None
    requests_in_minute: int = Field(description="As the process that answers has counted them.")
    requests_in_minute_limit: int | None = None

    @classmethod
    def of(cls, used: Used, quotas: Quotas, requests: int, settings: Settings) -> "UsageAnswer":
        return cls.restate(
            used,
            frames_limit=quotas.frames or None,
            stored_bytes_limit=quotas.stored_bytes or None,
            jobs_waiting_limit=quotas.jobs_waiting or None,
            requests_in_minute=requests,
            requests_in_minute_limit=settings.quota_requests_per_minute or None,
        )


class OwnOrganisationAnswer(
    Answer,
    restates=Organisation,
    fields="id name address refuses_incomplete_certificates time_zone created_at",
):
    usage: UsageAnswer | None = Field(default=None, description="In the answer to GET.")


router = Router(prefix="/v1/organisation", tags=["keys"])


@router.get("", response_model=OwnOrganisationAnswer, responses=problems())
def get_organisation(caller: Reader, context: UsesContext) -> Any:  # noqa: ANN401
    """The organisation that your key belongs to, and what it uses of what it may."""
    with context.database.reading() as session:
        row = session.get_one(Organisation, caller.organisation_id)
        used = read_usage(session, row.id)
    usage = UsageAnswer.of(used, context.quotas, context.rates.used(row.id), context.settings)
    return OwnOrganisationAnswer.restate(row, usage=usage).respond()


@router.patch("", response_model=OwnOrganisationAnswer, responses=problems(409))
def change_organisation(body: OrganisationChange, caller: Admin, writing: Writes) -> Response:
    """Set name and address of certificates, the time zone of cameras ("" for none), and what is refused."""

    def change(session: Session) -> Reply:
        organisation = session.get_one(Organisation, caller.organisation_id)
        if body.name is not None:
            require_free_name(session, body.name, but=organisation.id)
        for name, value in body.model_dump(exclude_unset=True).items():
            setattr(organisation, name, None if value == "" else value)
        session.flush()
        return Reply(status=200, body=OwnOrganisationAnswer.restate(organisation))

    return writing.run(caller, change)
