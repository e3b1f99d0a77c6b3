"""Signing in and out: which service, and as whom."""

from typing import Annotated

import typer

from stilb.client import Client
from stilb.commands.talk import Talk, config_folder, talks
from stilb.login import Login, forget_login, keep_login
from stilb.problem import Unclear
from stilb.records import OwnKey


@talks
def login(talk: Talk, address: Annotated[str, typer.Argument(metavar="URL", help="Of the service.")]) -> None:
    """Sign in: the key is checked against the service, then kept for this user (mode 600)."""
    address = address.rstrip("/")
    if not address.startswith(("http://", "https://")):
        raise Unclear(f"{address} is no address: it begins with http:// or https://")
    key = talk.key or typer.prompt("Key", hide_input=True, err=True).strip()
    with Client(address, key, retries=2) as client:
        own = client.own_key()
    path = keep_login(config_folder(), Login(url=address, key=key))
    talk.answer({**_told(address, own), "kept_in": str(path)}, f"{_sentence(address, own)}. Kept in {path}")


@talks
def logout(talk: Talk) -> None:
    """Forget the key on this machine. It stays valid until an admin revokes it."""
    there = forget_login(config_folder())
    talk.answer({"signed_out": there}, "Signed out." if there else "Nobody was signed in.")


@talks
def whoami(talk: Talk) -> None:
    """Tell as whom, where and with which scopes this machine asks."""
    found = talk.login()
    with talk.client() as client:
        own = client.own_key()
    talk.answer(_told(found.url, own), _sentence(found.url, own))


def _told(url: str, own: OwnKey) -> dict[str, object]:
    return {"url": url, **own.raw}


def _sentence(url: str, own: OwnKey) -> str:
    return f"{own.name!r} of {own.organisation} at {url}, may {', '.join(own.scopes)}"
