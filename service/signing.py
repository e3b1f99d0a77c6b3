"""The service's own Ed25519 key: it signs receipts, and its public half is published for good."""

import base64
import binascii
import hashlib
from typing import TYPE_CHECKING, Final

from sqlalchemy.exc import IntegrityError

from service.launch.refusal import Refusal
from store.database import Database
from store.settings import Settings, keep_secret
from store.tables import SigningKey

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

ALGORITHM: Final = "Ed25519"
_SEED_BYTES: Final = 32


def read_seed(settings: Settings) -> bytes:
    """Return the given private key, else the one kept in the data folder, made at the first start."""
    given = settings.signing_key.get_secret_value()
    if not given:
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
        """Return the signature in Base64."""
        return base64.b64encode(self.enrol().sign(message)).decode()
