"""Where this person's key is kept: one file of mode 600 in the platform's folder for configuration."""

import json
import os
from dataclasses import asdict, dataclass
from pathlib import Path

from stilb.problem import Unclear


@dataclass(frozen=True, kw_only=True)
class Login:
    url: str
    key: str


def read_login(folder: Path) -> Login | None:
    path = _path(folder)
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        return Login(url=kept["url"], key=kept["key"])
    except FileNotFoundError:
        return None
    except (ValueError, KeyError, TypeError) as error:
        raise Unclear(f"{path} cannot be read. Sign in again: stilb login URL") from error


def keep_login(folder: Path, login: Login) -> Path:
    """Keep it for this user alone; never half of it, and not for a moment readable for others."""
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    draft, path = folder / "login.json.draft", _path(folder)
    draft.unlink(missing_ok=True)
    with os.fdopen(
        os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="utf-8"
    ) as file:
        json.dump(asdict(login), file)
    draft.replace(path)
    return path


def forget_login(folder: Path) -> bool:
    """Remove it; whether there was one."""
    path = _path(folder)
    there = path.exists()
    path.unlink(missing_ok=True)
    return there


def choose_login(kept: Login | None, *, url: str | None, key: str | None) -> Login:
    """Take what was given, else what was kept; the kept key goes to the service that it was kept for only."""
    if url is None:
        if kept is None:
            raise Unclear("No login is stored. Sign in first: stilb login URL")
        return Login(url=kept.url, key=key or kept.key)
    url = url.rstrip("/")
    if key:
        return Login(url=url, key=key)
    if kept is None or kept.url != url:
        raise Unclear(f"No key is stored for {url}. Give --key or STILB_KEY, or sign in: stilb login {url}")
    return kept


def _path(folder: Path) -> Path:
    return folder / "login.json"
