"""Secrets that an installation makes for itself, and the secrets of webhooks that follow from one of them."""

import base64
import hashlib
import hmac
import os
import secrets
from pathlib import Path

from store.settings import Settings


def keep_secret(path: Path) -> bytes:
    """Read 32 random bytes that only this user may read; made at the first call."""
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        draft = path.with_name(f"{path.name}.{os.getpid()}")
        fd = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        with os.fdopen(fd, "wb") as file:
            file.write(secrets.token_bytes(32))
            file.flush()
            os.fsync(file.fileno())
        try:
            # never half a secret; and of two processes that start at once, the first one's is kept by both
            path.hardlink_to(draft)
        except FileExistsError:
            pass
        finally:
            draft.unlink()
    return path.read_bytes()


def derive_webhook_secret(settings: Settings, webhook_id: str) -> str:
    """Return the secret that signs a webhook's deliveries; the database has its hash alone."""
    given = settings.webhook_key.get_secret_value()
    key = given.encode() if given else keep_secret(settings.data / "webhook-key")
    secret = hmac.digest(key, f"webhook:{webhook_id}".encode(), hashlib.sha256)
    return f"whsec_{base64.b64encode(secret).decode()}"
