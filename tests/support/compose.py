"""What docker-compose.yml starts, for tests that start the very same without containers."""

import importlib
import re
import sys
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).parent.parent.parent
OURS = ("migrate", "service", "worker", "sweeper")
_VARIABLE = re.compile(r"\$\{(?P<name>\w+)(?::(?P<kind>[-?])(?P<text>[^}]*))?\}")


@cache
def compose() -> dict[str, Any]:
    """The whole file, its anchors resolved."""
    return yaml.safe_load((ROOT / "docker-compose.yml").read_text(encoding="utf-8"))


def command_of(name: str) -> list[str]:
    """A service's command, run by this very Python."""
    command = compose()["services"][name]["command"]
    return [sys.executable if part == "python" else part for part in command]


def environment_of(name: str, variables: Mapping[str, str]) -> dict[str, str]:
    """A service's environment, with the operator's variables filled in as Compose does."""
    environment = compose()["services"][name].get("environment", {})
    return {key: filled(value, variables) for key, value in environment.items()}


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
