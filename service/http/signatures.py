"""Signed sessions of browsers and addresses of uploads, and the key that signs receipts."""

import base64
import binascii
import hashlib
import hmac
import secrets
import time
from typing import TYPE_CHECKING, Final

from sqlalchemy.exc import IntegrityError

from service.launch.folder import Refusal
from service.launch.key import keep_secret
from store.database import Database
from store.settings import Settings
from store.tables import SigningKey

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey


SESSION_S: Final = 12 * 3600  # a working day; then one signs in again
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


ALGORITHM: Final = "Ed25519"
_SEED_BYTES: Final = 32


def read_seed(settings: Settings) -> bytes:
    """Return the given private key, else the one kept in the data folder, made at the first start."""
    if not (given := settings.signing_key.get_secret_value()):
        return keep_secret(settings.data / "signing-key")
    try:
        seed = base64.b64decode(given, validate=True)
    except binascii.Error:
        seed = b""
    if len(seed) != _SEED_BYTES:
        raise Refusal(f"STILB_SIGNING_KEY: must be {_SEED_BYTES} random bytes in Base64")
    return seed


class Signer:
    """Signs with one private key, after its public key has been stored for whoever verifies."""

    def __init__(self, seed: bytes, database: Database) -> None:
        self._seed = seed
        self._database = database
        self._key: Ed25519PrivateKey | None = None
        self.key_id = ""

    def enrol(self) -> "Ed25519PrivateKey":
        """Publish the public key, unless that was done before; no receipt may outrun it."""
        # three megabytes that a worker process of the service needs only for its first receipt
        from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey  # noqa: PLC0415
        from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat  # noqa: PLC0415

        if self._key is not None:
            return self._key
        key = Ed25519PrivateKey.from_private_bytes(self._seed)
        public = key.public_key()
        self.key_id = f"sgk_{hashlib.sha256(public.public_bytes_raw()).hexdigest()[:32]}"
        pem = public.public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo).decode()
        with self._database.reading() as session:
            known = session.get(SigningKey, self.key_id)
        if known is None:
            try:
                with self._database.writing("service") as session:
                    session.add(SigningKey(id=self.key_id, public_key=pem))
            except IntegrityError:
                pass  # another process of the same key was first
        self._key = key
        return key

    def sign(self, message: bytes) -> str:
        return base64.b64encode(self.enrol().sign(message)).decode()
