"""Settings, which every process reads once, in its main."""

import os
import re
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, Self
from urllib.parse import quote

from pydantic import BaseModel, ConfigDict, Field, SecretStr, ValidationError, model_validator

from store.pulse import DATABASE_TIMEOUT_S, SILENCES

if TYPE_CHECKING:
    from obstore.store import S3Config


_PREFIX = "STILB_"
_IN_FILE = "_FILE"
# of the command line, of who watches a process, and of the tests
_OTHERS = re.compile("URL|PULSE|CHROMIUM|PICTURES|ILLUSTRATIONS|TEST_.*")
_CANNOT_START_EXIT = 2
# of whole names, which begin alike
_ALIKE = 0.7
_BUCKET_SECRETS: Final = ("access_key_id", "secret_access_key", "session_token")
_DAY_S = 86_400.0
_ADDRESSES = {
    "DATABASE_URL": (
        r"postgresql\+psycopg://|sqlite:///",
        "must begin with postgresql+psycopg:// or sqlite:///",
    ),
    "BROKER_URL": (
        r"rediss?://|redis\+socket://|sentinel://",
        "must begin with redis://, rediss://, redis+socket:// or sentinel://",
    ),
    "BLOBS_URL": (
        r"(?!\w+://)|file:///|s3://[^/?#]+(/[^?#]*)?$",
        "must be a folder, file:///folder or s3://bucket/prefix",
    ),
    # another form would be started with, and fit no request
    "CORS_ORIGINS": (
        r"\*$|(\s*https?://[^/\s,]+/?\s*(,|$))+\s*$",
        "must be origins such as https://board.example, separated by commas",
    ),
    "ALLOWED_HOSTS": (
        r"(\s*(https?://)?[^/\s,*]+/?\s*(,|$))+\s*$",
        "must be host names such as https://calib.example, separated by commas",
    ),
}

# No infinity: it passes a lower limit, and no clock takes it.
Seconds = Annotated[float, Field(gt=0, le=_DAY_S)]
Grace = Annotated[float, Field(ge=0, le=_DAY_S)]


class SettingsWrong(Exception):  # noqa: N818 (it says what was found)
    """One line for each setting that cannot be used."""


class Settings(BaseModel):
    """One field a setting, ``STILB_<FIELD>``; an address left empty stands for the embedded part."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    data: Path = Path("stilb-data")
    host: str = "127.0.0.1"
    port: int = Field(default=8000, ge=0, le=65535)
    workers: int = Field(default=1, ge=1, le=64)
    key: SecretStr = SecretStr("")
    session_secret: SecretStr = SecretStr("")
    signing_key: SecretStr = SecretStr("")
    cors_origins: str = ""
    allowed_hosts: str = ""
    database_url: str = ""
    database_password: SecretStr = SecretStr("")
    database_timeout_s: Seconds = DATABASE_TIMEOUT_S
    broker_url: str = ""
    blobs_url: str = ""
    connections_per_peer: int = Field(default=512, ge=0)
    quota_bytes: int = Field(default=0, ge=0)
    quota_frames: int = Field(default=0, ge=0)
    quota_requests_per_minute: int = Field(default=30_000, ge=0)
    stop_grace_s: Grace = 15.0
    stop_notice_s: Grace = 0.0
    worker_threads: int = Field(default=2, ge=1, le=64)
    lease_s: Seconds = 30.0
    log: Literal["text", "json"] = "text"
    health_for: Literal["everybody", "operator"] = "everybody"
    decoder_sandbox: Literal["auto", "require"] = "auto"

    @property
    def effective_database_url(self) -> str:
        if password := self.database_password.get_secret_value():
            return self.database_url.replace("@", f":{quote(password, safe='')}@", 1)
        return self.database_url or f"sqlite:///{self.data.absolute() / 'stilb.sqlite'}"

    @model_validator(mode="after")
    def _know_addresses(self) -> Self:
        for name, (form, words) in _ADDRESSES.items():
            if (address := getattr(self, name.lower())) and not re.match(form, address):
                raise ValueError(f"{_PREFIX}{name}: {words}")
        return self

    @model_validator(mode="after")
    def _place_password(self) -> Self:
        if self.database_password.get_secret_value() and not re.match(r"[^:]+://[^:@/]+@", self.database_url):
            raise ValueError("STILB_DATABASE_PASSWORD needs a STILB_DATABASE_URL with a user and no password")
        return self

    @property
    def hang_s(self) -> float:
        """How long a process may make no progress [s]: longer than it may wait for the database."""
        return SILENCES * self.database_timeout_s

    @property
    def effective_broker_url(self) -> str:
        return self.broker_url or f"redis+socket://{self.data.absolute() / 'valkey.sock'}"

    @property
    def effective_blobs_url(self) -> str:
        return self.blobs_url or str(self.data.absolute() / "blobs")


def read_settings() -> Settings:
    """Read this process's settings; end the process with one line for each that cannot be used."""
    try:
        return _read_all()
    except SettingsWrong as wrong:
        for line in wrong.args:
            print(f"stilb: {line}", file=sys.stderr, flush=True)  # noqa: T201 (speaks to the terminal)
        sys.exit(_CANNOT_START_EXIT)


def _read_all() -> Settings:
    """Return the settings, those that a ``STILB_<FIELD>_FILE`` names read from that file."""
    if wrong := list(_misspelt(os.environ)):
        raise SettingsWrong(*wrong)
    read_bucket_secrets()
    ours = (each for each in os.environ.items() if each[0].startswith(_PREFIX))
    given = {name.removeprefix(_PREFIX): value for name, value in ours}
    read: dict[str, Any] = {}
    for field in Settings.model_fields:
        name = field.upper()
        if path := given.get(f"{name}{_IN_FILE}"):
            if given.get(name):
                message = f"{_PREFIX}{name}: also given as {_PREFIX}{name}{_IN_FILE}; remove one of them"
                raise SettingsWrong(message)
            read[field] = read_secret(f"{_PREFIX}{name}{_IN_FILE}", path)
        elif name in given:
            read[field] = given[name]
    try:
        return Settings(**read)
    except ValidationError as error:
        raise SettingsWrong(*map(_say, error.errors())) from error


def _say(found: Any) -> str:  # noqa: ANN401  one of pydantic's errors
    if not found["loc"]:
        return str(found["msg"]).removeprefix("Value error, ")
    return f"{_PREFIX}{str(found['loc'][0]).upper()}: {found['msg']}"


def _misspelt(environment: Mapping[str, str]) -> Iterator[str]:
    known = [f"{_PREFIX}{name.upper()}" for name in Settings.model_fields]
    known += [f"{name}{_IN_FILE}" for name in known]
    for name in environment:
        meant = name.upper()
        if not meant.startswith(_PREFIX) or name in known or _OTHERS.fullmatch(name.removeprefix(_PREFIX)):
            continue
        if meant in known:
            # the same setting in two spellings could have two values
            yield f"{name}: write {meant}: its name is in capitals"
        else:
            from difflib import get_close_matches  # noqa: PLC0415  1 MB that right settings do not need

            alike = get_close_matches(meant, known, n=1, cutoff=_ALIKE)
            nearest = f"did you mean {alike[0]}?" if alike else "docs/settings.md lists them."
            yield f"{name}: there is no such setting; {nearest}"


def read_secret(name: str, path: str) -> str:
    """Return what the file of this variable holds, without the spaces and line breaks around it."""
    try:
        text = Path(path).read_text(encoding="utf-8").strip()
    except OSError as error:
        raise SettingsWrong(f"{name}: {error}") from error
    except UnicodeDecodeError as error:
        raise SettingsWrong(f"{name}: {path}: {error}") from error
    if not text:
        # an empty setting stands for the embedded part, which would silently take the place of what was meant
        raise SettingsWrong(f"{name}: {path}: the file is empty")
    return text


def read_bucket_secrets() -> "S3Config":
    """Return what the files of ``AWS_<NAME>_FILE`` hold, by the names of the S3 client's options."""
    secrets: S3Config = {}
    for name in _BUCKET_SECRETS:
        variable = f"AWS_{name.upper()}{_IN_FILE}"
        if path := os.environ.get(variable):
            secrets[name] = read_secret(variable, path)
    return secrets
