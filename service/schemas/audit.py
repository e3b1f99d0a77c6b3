"""Entries of the audit trail, and the state of their chain."""

from typing import Literal

from pydantic import Field

from service.schemas.base import Answer
from store.tables import AuditEntry


class AuditEntryAnswer(
    Answer,
    restates=AuditEntry,
    fields="seq at actor action subject_type subject_id before after previous_sha256 sha256",
):
    actor_name: str | None = Field(default=None, description="Of the key, as it is named today.")
    subject_name: str | None = Field(default=None, description="Of what was changed, as it is named today.")
    about_id: str | None = Field(default=None, description="What the subject is or belongs to.")


class AuditChainAnswer(Answer):
    """State of an organisation's chain, as far as one request checks it."""

    state: Literal["intact", "broken", "unfinished"]
    entries: int = Field(ge=0, description="How many were checked by this request and are as they were.")
    head: str | None = Field(default=None, description="`seq:sha256` of the last entry. Note it elsewhere.")
    broken_at: int | None = Field(default=None, description="The first entry that is not as it was.")
    detail: str | None = None
    next: str | None = Field(default=None, description="Address that checks the next entries.")
