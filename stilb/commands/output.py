"""Options that all commands share (--url, --key, --json), the stored login, and the output of a command."""

import errno
import functools
import inspect
import json
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from enum import IntEnum
from pathlib import Path
from typing import Annotated, Any, TypeVar, overload

import typer
from rich.console import Console, RenderableType

from stilb import problem, transport
from stilb.client import Client
from stilb.field import files, template
from stilb.records import DEFAULT_METHOD

# Wide enough that a table in a file or a pipe loses nothing.
_WIDTH_OF_A_PIPE = 240
# Some four seconds, or eight: a restart of the service passes unseen.
_RETRIES = 5

Answer = TypeVar("Answer")


@dataclass(frozen=True, kw_only=True)
class Login:
    url: str
    key: str


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

    def client(self, *, retries: int = _RETRIES, on_retry: transport.OnRetry | None = None) -> Client:
        """Open a client with few retries, so that a user soon sees that the service does not answer."""
        login = self.login()
        return Client(login.url, login.key, retries=retries, on_retry=on_retry)

    def answer(self, result: object, *shown: RenderableType) -> None:
        if self.as_json:
            print_json(result)
            return
        for each in shown:
            self.out.print(each)

    def note(self, text: str) -> None:
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


def read_login(folder: Path) -> Login | None:
    path = _login_file(folder)
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        return Login(url=kept["url"], key=kept["key"])
    except FileNotFoundError:
        return None
    except (ValueError, KeyError, TypeError) as error:
        raise problem.Unclear(f"{path} cannot be read. Sign in again: stilb login URL") from error


def keep_login(folder: Path, login: Login) -> Path:
    """Keep it for this user alone; never half of it, and not for a moment readable for others."""
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    path = _login_file(folder)
    transport.write_whole(path, json.dumps(asdict(login)), mode=0o600)
    return path


def forget_login(folder: Path) -> bool:
    path = _login_file(folder)
    there = path.exists()
    path.unlink(missing_ok=True)
    return there


def choose_login(kept: Login | None, *, url: str | None, key: str | None) -> Login:
    """Take what was given, else what was kept; the kept key goes to the service that it was kept for only."""
    if not url:
        if kept is None:
            raise problem.NotSignedIn("No login is stored. Sign in first: stilb login URL")
        return Login(url=kept.url, key=key or kept.key)
    url = url.rstrip("/")
    if key:
        return Login(url=url, key=key)
    if kept is None or kept.url != url:
        message = f"No key is stored for {url}. Give --key or STILB_KEY, or sign in: stilb login {url}"
        raise problem.NotSignedIn(message)
    return kept


def _login_file(folder: Path) -> Path:
    return folder / "login.json"


def print_json(result: object) -> None:
    """One document, and nothing else, on stdout."""
    json.dump(result, sys.stdout, ensure_ascii=False, indent=1, allow_nan=False, default=str)
    sys.stdout.write("\n")


def _console(*, stderr: bool) -> Console:
    stream = sys.stderr if stderr else sys.stdout
    width = None if stream and stream.isatty() else _WIDTH_OF_A_PIPE
    # What is shown comes from files and from the service: no bracket in it is meant for the console.
    return Console(file=stream, width=width, markup=False, highlight=False, emoji=False, soft_wrap=not width)


def _shared(
    *,
    url: str | None = typer.Option(
        None, envvar="STILB_URL", help="Address of the service; default: the stored login."
    ),
    key: str | None = typer.Option(None, envvar="STILB_KEY", help="Key; default: the stored login."),
    as_json: bool = typer.Option(False, "--json", help="The result as one JSON document on stdout."),
) -> None:
    """Have the options of all commands."""


_SHARED = list(inspect.signature(_shared).parameters.values())


class Exit(IntEnum):
    """Exit codes for scripts. They are stable."""

    DONE = 0
    FINDINGS = 1
    USAGE = 2
    KEY = 3
    NOT_FOUND = 4
    REFUSED = 5
    NETWORK = 6
    SERVER = 7
    STILL_AT_WORK = 8
    BROKEN = 70
    INTERRUPTED = 130


_STEPS = {
    "unauthenticated": "Sign in with a valid key: stilb login URL",
    "scope_missing": "Ask an administrator of your organisation for a key with that scope, then: stilb "
    "login URL",
    "no_calibration_in_force": "Ask for what there is, or for another time with --at, or publish a version "
    "(stilb publish).",
    "regions_differ": "Measure both with the same --region or --grid, or add --other-region.",
    "region_missing": "Give it with --region, or draw it first, on the page or with stilb roi CAMPAIGN.",
    "campaign_incomplete": "Add the missing items, which stilb campaign show CAMPAIGN lists, then run "
    "this again.",
    "unreachable": "Check the address and the network (stilb doctor), then run this again: it continues.",
    "not_sent": "Check the address: it begins with http:// or https:// (stilb login URL).",
    "unexpected_answer": "Check the address: stilb login URL",
    "export_damaged": "Run this again: only missing files are downloaded.",
}


_STEPS_ON_DISK = {
    errno.ENOSPC: "Make room there, then run this again.",
    errno.EROFS: "Nothing can be written there: copy the files to another folder, and name that.",
}


def exit_of(error: BaseException) -> Exit:
    match error:
        case problem.Problem():
            return _exit_of_status(error.status)
        case TimeoutError():
            return Exit.STILL_AT_WORK
        case problem.NotSignedIn():
            return Exit.KEY
        case problem.Unclear() | OSError():
            return Exit.USAGE
        case _:
            return Exit.BROKEN


def next_step(error: BaseException) -> str:
    """Return what to do about an error, or "" if its message says so."""
    match error:
        case problem.Problem() if error.code in _STEPS:
            return _STEPS[error.code]
        case problem.Problem() if error.status >= 500:
            return "Try again later. If it persists, send the operator the output of stilb doctor."
        case TimeoutError():
            return "The service continues. stilb jobs shows the progress."
        case OSError():
            return _STEPS_ON_DISK.get(error.errno or 0, "")
        case _:
            return ""


def _exit_of_status(status: int) -> Exit:
    match status:
        case 401 | 403:
            return Exit.KEY
        case 404:
            return Exit.NOT_FOUND
        case status if status >= 500:
            return Exit.SERVER
        case status if status >= 400:
            return Exit.REFUSED
        case _:  # no answer, or one that did not come whole
            return Exit.NETWORK


_DAY = re.compile(r"\d{4}-\d\d-\d\d")


def write_moment(text: str) -> str:
    """Return a time as short as `read_moment` takes it."""
    return text.removesuffix("T00:00:00Z")


@overload
def read_moment(text: str) -> str: ...
@overload
def read_moment(text: None) -> None: ...
def read_moment(text: str | None) -> str | None:
    """A day is its beginning in UTC, "now" is now; anything else is a time with its zone."""
    if text is None:
        return None
    if text == "now":
        return datetime.now(UTC).isoformat(timespec="seconds")
    if _DAY.fullmatch(text):
        text = f"{text}T00:00:00Z"
    try:
        zoned = datetime.fromisoformat(text).tzinfo is not None
    except ValueError:
        zoned = False
    if not zoned:
        raise problem.Unclear(
            f"{text!r} is not a time: give a day (2026-05-01), now, or a time with its zone "
            "(2026-05-01T20:30:00Z)"
        )
    return text


_WITHIN_S = 2.0
_MOST = 200


def complete_role(incomplete: str) -> list[str]:
    return [role for role in files.ROLES if role.startswith(incomplete)]


def complete_method(incomplete: str) -> list[str]:
    return [name for name in template.read_methods() if name.startswith(incomplete)]


def complete_model(incomplete: str) -> list[str]:
    return [model for model in template.list_choices(DEFAULT_METHOD, "model") if model.startswith(incomplete)]


def complete_campaign(incomplete: str) -> list[str]:
    """Return project numbers, else ids, of the service that this user is signed in to."""
    return _ask(lambda client: (each.project_number or each.id for each in client.campaigns()), incomplete)


def complete_camera(incomplete: str) -> list[str]:
    return _ask(lambda client: (each.serial for each in client.cameras()), incomplete)


def _ask(list_names: Callable[[Client], Iterator[str]], incomplete: str) -> list[str]:
    """Return what the service lists; nothing, soon and without a word, where it cannot be asked."""
    found = dict[str, None]()
    with suppress(problem.Problem, problem.Unclear, OSError):
        login = choose_login(read_login(config_folder()), url=None, key=None)
        with Client(login.url, login.key, timeout=_WITHIN_S, retries=0) as client:
            for name in list_names(client):
                if name.startswith(incomplete):
                    found[name] = None
                if len(found) == _MOST:
                    break
    return list(found)


CampaignNamed = Annotated[
    str,
    typer.Argument(metavar="CAMPAIGN", help="Its id or project number.", autocompletion=complete_campaign),
]
CampaignChosen = Annotated[
    str | None, typer.Option(help="Its id or project number.", autocompletion=complete_campaign)
]
