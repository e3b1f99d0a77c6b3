"""Sessions of a browser: a signed token that names the session's row and an end, and holds no secret.

The row and its key are looked up on every request: a session ends when it is signed out, when somebody who
may ends it, and when its key is revoked or expires.
"""

import hashlib
import hmac
import secrets
import time
from typing import Final

from store.settings import Settings, keep_secret

SESSION_S: Final = 12 * 3600
"""A working day; then one signs in again."""
CSRF_HEADER: Final = "X-CSRF-Token"


class Sessions:
    """Makes tokens and knows its own again."""

    def __init__(self, secret: bytes) -> None:
        self._secret = secret
        # a browser sends a cookie to every port of a host: two services there must not share one
        self.cookie = f"stilb_session_{self._sign('cookie', '')[:8]}"

    def open(self, session_id: str) -> str:
        """A token for the browser that a session was opened for, good for SESSION_S."""
        claim = f"{session_id}.{int(time.time()) + SESSION_S}.{secrets.token_urlsafe(12)}"
        return f"{claim}.{self._sign('session', claim)}"

    def session_id_of(self, token: str) -> str | None:
        """The session that a token stands for; None when it is not ours, or over."""
        claim, _, signature = token.rpartition(".")
        if not _same(signature, self._sign("session", claim)):
            return None
        session_id, expires, _ = claim.split(".")
        return session_id if time.time() < int(expires) else None

    def csrf_token(self, token: str) -> str:
        """Return the token that a page sends with every change, and a stranger's page cannot know."""
        return self._sign("csrf", token)

    def is_csrf_token(self, token: str, given: str) -> bool:
        return _same(given, self.csrf_token(token))

    def upload_token(self, text: str) -> str:
        """The secret part of an upload's address: the same for the same text."""
        return self._sign("upload", text)

    def _sign(self, purpose: str, text: str) -> str:
        return hmac.new(self._secret, f"{purpose}:{text}".encode(), hashlib.sha256).hexdigest()


def sessions_of(settings: Settings) -> Sessions:
    """The secret is the given one, else the one kept in the data folder, made at the first start."""
    given = settings.session_secret.get_secret_value()
    return Sessions(given.encode() if given else keep_secret(settings.data / "session-secret"))


def _same(given: str, expected: str) -> bool:
    return hmac.compare_digest(given.encode("utf-8", "replace"), expected.encode())
