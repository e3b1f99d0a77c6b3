"""Entries of the audit trail."""

from service.schemas.base import Answer
from store.tables import AuditEntry


class AuditEntryAnswer(
    Answer,
    restates=AuditEntry,
    fields="seq at actor action subject_type subject_id before after previous_sha256 sha256",
):
    pass
