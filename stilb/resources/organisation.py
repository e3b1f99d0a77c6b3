"""Keys and sessions of the own organisation, for its administrators."""

from collections.abc import Iterator, Sequence
from typing import Any

from stilb.connection import Connection
from stilb.problem import Unclear, missing
from stilb.records import Key, Moment, Session, as_text
from stilb.transport import Call, address


class Organisation(Connection):
    """Keys and the browser sessions opened with them."""

    def api_keys(self) -> Iterator[Key]:
        """Return all keys, also those that have ended, without their secrets."""
        return map(Key.of, self._transport.items(address("keys")))

    def create_key(self, name: str, scopes: Sequence[str], *, expires_at: Moment | None = None) -> Key:
        """Make a key; its ``secret`` is in this answer only."""
        body = {"name": name, "scopes": list(scopes)}
        return Key.of(
            self._post(address("keys"), body | ({"expires_at": as_text(expires_at)} if expires_at else {}))
        )

    def revoke_key(self, key: Key | str) -> Key:
        """Revoke a key, by its id or its name, and end its sessions."""
        return Key.of(self._delete(address("keys", self._id_of(key) if isinstance(key, str) else key.id)))

    def sessions(self) -> Iterator[Session]:
        """Return the browsers that are signed in: with this key, or for an administrator with any."""
        return map(Session.of, self._transport.items(address("sessions")))

    def end_sessions(self) -> int:
        """End all those sessions; returns how many."""
        return int(self._delete(address("sessions"))["ended"])

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
