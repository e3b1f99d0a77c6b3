"""Options that all commands share (--url, --key, --json), and the output of a command as text or JSON."""

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
    """Output of one command: results on stdout, everything else on stderr."""

    url: str | None
    key: str | None
    as_json: bool
    out: Console = field(default_factory=lambda: _console(stderr=False))
    err: Console = field(default_factory=lambda: _console(stderr=True))

    def login(self) -> Login:
        return choose_login(read_login(config_folder()), url=self.url, key=self.key)

    def client(self, *, retries: int = _RETRIES, on_retry: OnRetry | None = None) -> Client:
        """Open a client with few retries, so that a user soon sees that the service does not answer."""
        login = self.login()
        return Client(login.url, login.key, retries=retries, on_retry=on_retry)

    def answer(self, result: object, *shown: RenderableType) -> None:
        """Write the result as one JSON document, or as text."""
        if self.as_json:
            print_json(result)
            return
        for each in shown:
            self.out.print(each)

    def note(self, text: str) -> None:
        """Write a note on stderr."""
        self.err.print(text)


def command(function: Callable[..., Answer]) -> Callable[..., Answer]:
    """Add the options --url, --key and --json to a function, and pass it an ``Output`` made of them."""

    @functools.wraps(function)
    def with_output(*, url: str | None, key: str | None, as_json: bool, **given: Any) -> Answer:  # noqa: ANN401
        return function(Output(url=url, key=key, as_json=as_json), **given)

    # typer reads the options from the signature; the first parameter, the output, is not an option.
    own = list(inspect.signature(function, eval_str=True).parameters.values())[1:]
    keyword = [each.replace(kind=inspect.Parameter.KEYWORD_ONLY) for each in own]
    signature = inspect.Signature(keyword + _SHARED)
    with_output.__signature__ = signature  # type: ignore[attr-defined]
    with_output.__annotations__ = {each.name: each.annotation for each in signature.parameters.values()}
    return with_output


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
            str | None,
            typer.Option(envvar="STILB_URL", help="Address of the service; default: the stored login."),
        ],
        None,
    ),
    _shared(
        "key",
        Annotated[str | None, typer.Option(envvar="STILB_KEY", help="Key; default: the stored login.")],
        None,
    ),
    _shared(
        "as_json",
        Annotated[bool, typer.Option("--json", help="The result as one JSON document on stdout.")],
        False,
    ),
]
