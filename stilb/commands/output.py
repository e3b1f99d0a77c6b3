"""What every command shares: --url, --key and --json, a client, and two ways to answer."""

import functools
import inspect
import json
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer
from rich.console import Console, RenderableType

from stilb.client import Client
from stilb.login import Login, choose_login, read_login
from stilb.transport import OnRetry

# Wide enough that a table in a file or a pipe loses nothing.
_WIDTH_OF_A_PIPE = 240
# Some four seconds, or eight: a restart of the service passes unseen.
_RETRIES = 5

Answer = TypeVar("Answer")


@dataclass(frozen=True, kw_only=True)
class Output:
    """One command's way to the service and to the person: results on stdout, all else on stderr."""

    url: str | None
    key: str | None
    as_json: bool
    out: Console = field(default_factory=lambda: _console(stderr=False))
    err: Console = field(default_factory=lambda: _console(stderr=True))

    def login(self) -> Login:
        return choose_login(read_login(config_folder()), url=self.url, key=self.key)

    def client(self, *, retries: int = _RETRIES, on_retry: OnRetry | None = None) -> Client:
        """A connection; a person who waits before a screen is told soon that nothing answers."""
        login = self.login()
        return Client(login.url, login.key, retries=retries, on_retry=on_retry)

    def answer(self, result: object, *shown: RenderableType) -> None:
        """The result: as one JSON document, or as it is shown to a person."""
        if self.as_json:
            print_json(result)
            return
        for each in shown:
            self.out.print(each)

    def note(self, text: str) -> None:
        """What is worth knowing beside the result."""
        self.err.print(text)


def talks(command: Callable[..., Answer]) -> Callable[..., Answer]:
    """Give a command the options --url, --key and --json, and itself a ``Output`` made of them."""

    @functools.wraps(command)
    def with_talk(*, url: str | None, key: str | None, as_json: bool, **given: Any) -> Answer:  # noqa: ANN401
        return command(Output(url=url, key=key, as_json=as_json), **given)

    # typer reads the options from the signature; the first parameter, the talk, is not among them.
    own = list(inspect.signature(command, eval_str=True).parameters.values())[1:]
    keyword = [each.replace(kind=inspect.Parameter.KEYWORD_ONLY) for each in own]
    signature = inspect.Signature(keyword + _SHARED)
    with_talk.__signature__ = signature  # type: ignore[attr-defined]
    with_talk.__annotations__ = {each.name: each.annotation for each in signature.parameters.values()}
    return with_talk


def config_folder() -> Path:
    """Where this user's key and journals lie."""
    return Path(typer.get_app_dir("stilb"))


def print_json(result: object) -> None:
    """One document, and nothing else, on stdout."""
    json.dump(result, sys.stdout, ensure_ascii=False, indent=1, allow_nan=False, default=str)
    sys.stdout.write("\n")


def without_none(row: Mapping[str, object]) -> dict[str, object]:
    """As the service answers: what is absent is left out."""
    return {name: value for name, value in row.items() if value is not None}


def _console(*, stderr: bool) -> Console:
    stream = sys.stderr if stderr else sys.stdout
    width = None if stream.isatty() else _WIDTH_OF_A_PIPE
    # What is shown comes from files and from the service: no bracket in it is meant for the console.
    return Console(file=stream, width=width, markup=False, highlight=False, emoji=False, soft_wrap=not width)


def _shared(name: str, kind: object, default: object) -> inspect.Parameter:
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=kind)


_SHARED = [
    _shared(
        "url",
        Annotated[
            str | None, typer.Option(envvar="STILB_URL", help="The service; else where you signed in.")
        ],
        None,
    ),
    _shared(
        "key",
        Annotated[
            str | None, typer.Option(envvar="STILB_KEY", help="The key; else the one you signed in with.")
        ],
        None,
    ),
    _shared(
        "as_json",
        Annotated[bool, typer.Option("--json", help="The result as one JSON document on stdout.")],
        False,
    ),
]
