"""An organisation as its own keys see and change it."""

from pydantic import Field

from service.schemas.base import Answer, ClearableLong, Form
from store.settings import Settings
from store.tables import Organisation
from store.usage import Quotas, Used


class OrganisationChange(Form):
    address: ClearableLong | None = None
    refuses_incomplete_certificates: bool | None = Field(
        default=None,
        description="Publishing answers 409 `certificate_incomplete` while a certificate has gaps.",
        strict=True,
    )


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
    Answer, restates=Organisation, fields="id name address refuses_incomplete_certificates created_at"
):
    usage: UsageAnswer | None = Field(default=None, description="In the answer to GET.")
