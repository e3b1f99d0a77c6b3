"""The key with every scope that a new installation starts from, and other secrets that it makes itself."""

import os
import secrets
import sys
from contextlib import suppress
from pathlib import Path
from typing import Final

from service.launch.folder import Refusal, close_to_others, report

SHORTEST: Final = 32
_FEWEST_DIFFERENT: Final = 6
_PREFIX: Final = "stilb_"


def bootstrap_key(data: Path, given: str) -> str:
    """Return the given key, else the one kept in the data folder, which is made at the first start."""
    if given:
        refuse_weak_key(given, "STILB_KEY")
        return given
    path = data / "key"
    try:
        new = f"{_PREFIX}{secrets.token_urlsafe(32)}\n"
        key = keep_secret(path, new.encode()).decode("ascii").strip()
    except (OSError, ValueError) as error:
        raise Refusal(f"the key in {path} cannot be kept or read: {error}") from error
    if not key:
        raise Refusal(f"the key in {path} is empty; remove the file to have a new one made")
    refuse_weak_key(key, str(path))
    return key


def refuse_weak_key(key: str, place: str) -> None:
    """Refuse a key that could be guessed; chance gives 32 characters more than five different ones."""
    secret = key.removeprefix(_PREFIX)
    if not (key.isascii() and key.isprintable() and " " not in key):
        fault = "holds characters that no request can send: use letters, digits, - and _"
    elif len(secret) < SHORTEST:
        fault = f"has {len(secret)} characters; it needs {SHORTEST} random ones"
    elif len(set(secret)) < _FEWEST_DIFFERENT or secret in (secret + secret)[1:-1]:
        fault = f"repeats itself; it needs {SHORTEST} random characters"
    else:
        return
    make = "python3 -c 'import secrets; print(secrets.token_urlsafe(32))'"
    hint = f"make one with: {make}"
    raise Refusal(f"the key in {place} {fault}; {hint}")


def keep_secret(path: Path, new: bytes = b"") -> bytes:
    """Read what only this user may read; the first call makes it, of `new` or of 32 random bytes."""
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        draft = path.with_name(f"{path.name}.{os.getpid()}")
        try:
            fd = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
            with os.fdopen(fd, "wb") as file:
                file.write(new or secrets.token_bytes(32))
                file.flush()
                os.fsync(file.fileno())
            # of two processes that start at once, the first one's is kept by both
            with suppress(FileExistsError):
                path.hardlink_to(draft)
        finally:
            draft.unlink(missing_ok=True)
    return path.read_bytes()


def main() -> int:
    """Print the first key, for whoever starts the processes one by one."""
    from store.settings import read_settings  # noqa: PLC0415  the launcher does without

    settings = read_settings()
    try:
        close_to_others(settings.data.absolute(), report)
        print(bootstrap_key(settings.data, settings.key.get_secret_value()))  # noqa: T201
    except Refusal as refusal:
        report(str(refusal))
        return refusal.code
    return 0


if __name__ == "__main__":
    sys.exit(main())
