"""Keys, sessions and audit trail of the own organisation, for its administrators."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Unpack

import httpx

from stilb.connection import Connection
from stilb.details import Moment, OrganisationChange, PersonDetails, as_text
from stilb.problem import Unclear, missing
from stilb.records import AuditChain, AuditEntry, Key, Session
from stilb.transport import Call, address


class Organisation(Connection):
    """Keys, the browser sessions opened with them, and the audit trail."""

    def organisation(self) -> dict[str, Any]:
        """Return name, address and time zone of the organisation, and what it uses."""
        return self._get(address("organisation"))

    def change_organisation(self, **details: Unpack[OrganisationChange]) -> dict[str, Any]:
        return self._transport.json(Call(method="PATCH", path=address("organisation"), json=dict(details)))

    def api_keys(self) -> Iterator[Key]:
        """Return all keys, also those that have ended, without their secrets."""
        return map(Key.of, self._transport.items(address("keys")))

    def create_key(
        self,
        name: str,
        scopes: Sequence[str],
        *,
        expires_at: Moment | None = None,
        **person: Unpack[PersonDetails],
    ) -> Key:
        """Make a key; its ``secret`` is in this answer only."""
        end = {"expires_at": as_text(expires_at)} if expires_at else {}
        return Key.of(self._post(address("keys"), {"name": name, "scopes": list(scopes), **end, **person}))

    def change_key(self, key: Key | str, **person: Unpack[PersonDetails]) -> Key:
        """State who uses a key, by its id or its name: that person signs the certificates it publishes."""
        path = address("keys", self._id_of(key) if isinstance(key, str) else key.id)
        return Key.of(self._transport.json(Call(method="PATCH", path=path, json=dict(person))))

    def revoke_key(self, key: Key | str) -> Key:
        """Revoke a key, by its id or its name, and end its sessions."""
        return Key.of(self._delete(address("keys", self._id_of(key) if isinstance(key, str) else key.id)))

    def sessions(self) -> Iterator[Session]:
        """Return the browsers that are signed in: with this key, or for an administrator with any."""
        return map(Session.of, self._transport.items(address("sessions")))

    def end_sessions(self) -> int:
        """End all those sessions; returns how many."""
        return int(self._delete(address("sessions"))["ended"])

    def audit(self, **chosen: str) -> Iterator[AuditEntry]:
        """Return entries, newest first, chosen by ``actor``, ``action``, ``subject_id``, ``from``, ``to``."""
        return map(AuditEntry.of, self._transport.items(address("audit"), chosen))

    def save_audit(self, path: Path | str, **chosen: str) -> None:
        """Save entries, oldest first, as .csv or, with all that their hashes cover, as .jsonl."""
        name = "entries.jsonl" if str(path).endswith(".jsonl") else "entries.csv"
        self._transport.download(
            Call(method="GET", path=f"{address('audit')}/{name}", query=chosen), Path(path)
        )

    def check_audit(self) -> AuditChain:
        """Have the service recompute the hashes of all entries."""
        entries = 0
        query: dict[str, str] = {}
        while True:
            answer = self._get(f"{address('audit')}/chain", query)
            entries += answer["entries"]
            if "next" not in answer:
                return AuditChain.of({**answer, "entries": entries})
            query = dict(httpx.URL(answer["next"]).params)

    def _id_of(self, named: str) -> str:
        found = [
            key.id for key in self.api_keys() if named == key.id or (named == key.name and not key.ended)
        ]
        if len(found) > 1:
            raise Unclear(f"Several keys are named {named!r}: {', '.join(found)}. Give the id of one.")
        if not found:
            raise missing(f"No key in force is named {named!r}.")
        return found[0]

    def _delete(self, path: str) -> dict[str, Any]:
        return self._transport.json(Call(method="DELETE", path=path))
