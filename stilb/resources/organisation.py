"""Keys and audit trail of the own organisation, for its administrators."""

import re
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime
from pathlib import Path
from typing import Any

import httpx

from stilb import records
from stilb.problem import Problem, only
from stilb.transport import Call, Connection, Transport, address

_SAMPLE = re.compile(r'^(?P<name>\w+)(?:\{\w+="(?P<label>[^"]*)"\})? (?P<value>\S+)$', re.MULTILINE)


@dataclass(frozen=True, kw_only=True)
class Health:
    """State of a service when it was asked. None: not reported, as where a proxy keeps /metrics to itself.

    ``clock_ahead_s``: the service's clock minus this machine's, to half a second.
    """

    ready: bool
    detail: str
    answered_in_s: float
    clock_ahead_s: float | None
    version: str | None
    oldest_queued_s: float | None
    quarantined_jobs: int | None
    free_bytes: int | None


def examine(transport: Transport) -> Health:
    """Check once; raises ``Problem`` only where nothing answers at all."""
    sent_at, began = datetime.now(UTC), time.monotonic()
    ready, detail = True, "database and file store answer"
    try:
        date = transport.send(Call(method="GET", path="/readyz")).headers.get("Date")
    except Problem as problem:
        if problem.status == 0:
            raise
        ready, detail, date = False, problem.detail, None
    took_s = time.monotonic() - began
    samples = _read_metrics(transport)
    return Health(
        ready=ready,
        detail=detail,
        answered_in_s=took_s,
        clock_ahead_s=_clock_ahead_s(date, sent_at, took_s),
        version=next((label for name, label in samples if name == "stilb_info"), None),
        oldest_queued_s=samples.get(("stilb_oldest_queued_job_age_seconds", "")),
        quarantined_jobs=_whole(samples.get(("stilb_jobs", "quarantined"))),
        free_bytes=_whole(samples.get(("stilb_data_free_bytes", ""))),
    )


def _read_metrics(transport: Transport) -> dict[tuple[str, str], float]:
    try:
        text = transport.send(Call(method="GET", path="/metrics")).text
    except Problem:
        return {}
    return {(found["name"], found["label"] or ""): float(found["value"]) for found in _SAMPLE.finditer(text)}


def _clock_ahead_s(date: str | None, sent_at: datetime, took_s: float) -> float | None:
    if date is None:
        return None
    try:
        there = parsedate_to_datetime(date)
    except ValueError:
        return None
    # The header holds whole seconds, cut off; the answer was made about halfway.
    return (there - sent_at).total_seconds() + 0.5 - took_s / 2


def _whole(value: float | None) -> int | None:
    return None if value is None else int(value)


class Organisation(Connection):
    """The organisation, its keys and its audit trail."""

    def organisation(self) -> dict[str, Any]:
        """Return name, address and time zone of the organisation, and what it uses."""
        return self._get(address("organisation"))

    def change_organisation(self, **details: str | bool) -> dict[str, Any]:
        """Change name, address, time_zone or refuses_incomplete_certificates; "" takes a text away."""
        return self._patch(address("organisation"), details)

    def api_keys(self) -> Iterator[records.Key]:
        """Return all keys, also those that have ended, without their secrets."""
        return map(records.Key.of, self._items(address("keys")))

    def create_key(
        self, name: str, scopes: Sequence[str], *, expires_at: records.Moment | None = None, **person: str
    ) -> records.Key:
        """Make a key, for a `person` and `role`; its ``secret`` is in this answer only."""
        end = {"expires_at": records.as_text(expires_at)} if expires_at else {}
        return records.Key.of(
            self._post(address("keys"), {"name": name, "scopes": list(scopes), **end, **person})
        )

    def change_key(self, key: records.Key | str, **person: str) -> records.Key:
        """State the `person` and `role` that use a key, by its id or name; "" takes one away."""
        return records.Key.of(self._patch(address("keys", self._id_of(key)), person))

    def revoke_key(self, key: records.Key | str) -> records.Key:
        """Revoke a key, by its id or its name, and end its sessions."""
        return records.Key.of(self._delete(address("keys", self._id_of(key))))

    def audit(self, **chosen: str) -> Iterator[records.AuditEntry]:
        """Return entries, newest first, chosen by ``actor``, ``action``, ``subject_id``, ``from``, ``to``."""
        return map(records.AuditEntry.of, self._items(address("audit"), chosen))

    def save_audit(self, path: Path | str, **chosen: str) -> None:
        """Save entries, oldest first, as .csv or, with all that their hashes cover, as .jsonl."""
        name = "entries.jsonl" if str(path).endswith(".jsonl") else "entries.csv"
        self._save(path, address("audit", name), chosen)

    def check_audit(self) -> records.AuditChain:
        """Have the service recompute the hashes of all entries."""
        entries = 0
        query: dict[str, str] = {}
        while True:
            answer = self._get(f"{address('audit')}/chain", query)
            entries += answer["entries"]
            if "next" not in answer:
                return records.AuditChain.of({**answer, "entries": entries})
            query = dict(httpx.URL(answer["next"]).params)

    def _id_of(self, named: records.Key | str) -> str:
        if isinstance(named, records.Key):
            return named.id
        found = [
            key.id for key in self.api_keys() if named == key.id or (named == key.name and not key.ended)
        ]
        several = f"Several keys are named {named!r}: {', '.join(found)}. Give the id of one."
        return only(found, several=several, none=f"No key in force is named {named!r}.")


class System(Connection):
    """Own key, and state of the service."""

    def own_key(self) -> records.OwnKey:
        """The key that this client asks with: its organisation and its scopes."""
        return records.OwnKey.of(self._get(address("keys", "own")))

    def health(self) -> Health:
        """How the service fares, as far as it tells."""
        return examine(self._transport)
