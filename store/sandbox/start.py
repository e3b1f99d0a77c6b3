"""How a process that will be shut in is started: with nothing that its parent knows."""

import os
import sys
from pathlib import Path
from typing import Final

_ROOT: Final = Path(__file__).resolve().parents[2]
_KEPT: Final = ("PATH", "LANG", "PYTHONDONTWRITEBYTECODE")


def build_command(module: str) -> list[str]:
    """Return the command that runs one of our modules with this interpreter."""
    return [sys.executable, "-s", "-P", "-m", module]


def build_environment() -> dict[str, str]:
    """Return an environment without settings and credentials. One thread per library."""
    kept = {name: os.environ[name] for name in _KEPT if name in os.environ}
    return {**kept, "PYTHONPATH": str(_ROOT), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
