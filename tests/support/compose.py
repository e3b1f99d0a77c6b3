"""What docker-compose.yml starts, for tests that start the very same without containers."""

import importlib
import re
import sys
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from service.command import COMMANDS

ROOT = Path(__file__).parent.parent.parent
OURS = ("migrate", "service", "worker")
_VARIABLE = re.compile(r"\$\{(?P<name>\w+)(?::(?P<kind>[-?])(?P<text>[^}]*))?\}")


S3 = "docs/deploy/compose.s3.yml"
TLS = "docs/deploy/compose.tls.yml"


class _Loader(yaml.SafeLoader):
    """Compose's own tag for what an override takes away."""


_Loader.add_constructor("!reset", lambda _loader, _node: [])


@cache
def compose(path: str = "docker-compose.yml") -> dict[str, Any]:
    """The whole file, its anchors resolved."""
    return yaml.load((ROOT / path).read_text(encoding="utf-8"), _Loader)


def command_of(name: str) -> list[str]:
    """A service's command, run by this very Python."""
    command, *others = compose()["services"][name]["command"]
    if command == "stilb-server":
        command, *others = COMMANDS[others[0]].module, *others[1:]
    return [sys.executable, "-m", command, *others]


def environment_of(name: str, variables: Mapping[str, str], *overrides: str) -> dict[str, str]:
    """A service's environment, with the operator's variables filled in as Compose does."""
    environment: dict[str, str | None] = {}
    for path in ("docker-compose.yml", *overrides):
        environment |= compose(path)["services"].get(name, {}).get("environment", {})
    given = {key: variables.get(key) if value is None else value for key, value in environment.items()}
    return {key: filled(value, variables) for key, value in given.items() if value is not None}


def filled(text: str, variables: Mapping[str, str]) -> str:
    """A value with `${NAME}`, `${NAME:-default}` and `${NAME:?complaint}` replaced."""

    def value(match: re.Match[str]) -> str:
        given = variables.get(match["name"], "")
        if not given and match["kind"] == "?":
            raise KeyError(f"{match['name']}: {match['text']}")
        return given or (match["text"] or "" if match["kind"] == "-" else "")

    return _VARIABLE.sub(value, text)


def load_script(name: str):
    """A script of .ci/, which is no package."""
    if (folder := str(ROOT / ".ci")) not in sys.path:
        sys.path.append(folder)
    return importlib.import_module(name)
