"""The key with every scope that a new installation starts from."""

import os
import secrets
from pathlib import Path

from service.launch.refusal import Refusal


def bootstrap_key(data: Path, given: str) -> str:
    """Return the given key, else the one kept in the data folder, which is made at the first start."""
    if given:
        return given
    path = data / "key"
    try:
        if not path.exists():
            _write_whole(path, f"stilb_{secrets.token_urlsafe(32)}\n")
        key = path.read_text(encoding="ascii").strip()
    except (OSError, ValueError) as error:
        raise Refusal(f"the key in {path} cannot be kept or read: {error}") from error
    if not key:
        raise Refusal(f"the key in {path} is empty; remove the file to have a new one made")
    return key


def _write_whole(path: Path, text: str) -> None:
    """Never half a key, and never readable for others."""
    draft = path.with_name("key.draft")
    draft.unlink(missing_ok=True)
    fd = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(fd, "w", encoding="ascii") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
    draft.replace(path)
