"""Signing in and out, and the stored login."""

from http import HTTPStatus
from typing import Annotated

import typer

from stilb.client import Client
from stilb.commands.output import Output, command, config_folder
from stilb.login import Login, forget_login, keep_login
from stilb.problem import Problem, Unclear
from stilb.records import OwnKey


@command
def login(
    output: Output, address: Annotated[str, typer.Argument(metavar="URL", help="Address of the service.")]
) -> None:
    """Sign in: the key is checked, then stored for you only.

    It is asked for, unless --key or STILB_KEY gives it, and kept in a file of mode 600.
    """
    address = address.rstrip("/")
    if not address.startswith(("http://", "https://")):
        raise Unclear(f"{address} is not an address: it must begin with http:// or https://")
    key = output.key or _ask_for_key()
    with Client(address, key, retries=2) as client:
        own = _own_key(client, address)
    path = keep_login(config_folder(), Login(url=address, key=key))
    output.answer(
        {**_describe(address, own), "kept_in": str(path)}, f"{_sentence(address, own)}. Stored in {path}"
    )


def _ask_for_key() -> str:
    try:
        return str(typer.prompt("Key", hide_input=True, err=True)).strip()
    except typer.Abort as end:
        # a script has no terminal to type at
        if isinstance(end.__context__, EOFError):
            raise Unclear("no key was entered: give it with --key, or in STILB_KEY") from end
        raise


def _own_key(client: Client, address: str) -> OwnKey:
    try:
        return client.own_key()
    except Problem as problem:
        if problem.status != HTTPStatus.NOT_FOUND:
            raise
        raise Unclear(
            f"{address} is not the address of a service. Give it without a path: http://127.0.0.1:8000"
        ) from problem


@command
def logout(output: Output) -> None:
    """Delete the key on this machine. It stays valid until an administrator revokes it."""
    there = forget_login(config_folder())
    output.answer({"signed_out": there}, "Signed out." if there else "You were not signed in.")


@command
def whoami(output: Output) -> None:
    """Show the stored key: its owner, service and scopes."""
    found = output.login()
    with output.client() as client:
        own = client.own_key()
    output.answer(_describe(found.url, own), _sentence(found.url, own))


def _describe(url: str, own: OwnKey) -> dict[str, object]:
    return {"url": url, **own.raw}


def _sentence(url: str, own: OwnKey) -> str:
    return f"{own.name!r} of {own.organisation} at {url}, may {', '.join(own.scopes)}"
