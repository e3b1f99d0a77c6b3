"""Version of the client."""

import tomllib
from functools import cache
from importlib import metadata
from pathlib import Path


@cache
def read_version() -> str:
    """Return the version in `pyproject.toml` of a checkout, else that of the installed package."""
    path = Path(__file__).parents[1] / "pyproject.toml"
    if path.is_file():
        project = tomllib.loads(path.read_text(encoding="utf-8")).get("project", {})
        if project.get("name") == "stilb":
            return str(project["version"])
    return metadata.version("stilb")
