"""Imports at the start of a process, which cost time and memory in each."""

import subprocess
import sys
import tomllib
from pathlib import Path

LINTS = tomllib.loads(Path("pyproject.toml").read_text())["tool"]["ruff"]["lint"]
LARGE = {
    *LINTS["flake8-tidy-imports"]["banned-module-level-imports"],
    *("imagecodecs", "rawpy", "scipy.stats", "typst"),
}


def test_processes_start_without_large_libraries():
    program = (
        "import sys, service.__main__, worker.upkeep, worker.background, store.migrate\n"
        "service.http.app._include_routers(service.http.app.FastAPI())\n"
        "assert 'service.measurements.stac' in sys.modules\n"
        f"sys.exit(' '.join({LARGE} & sys.modules.keys()) or None)"
    )
    done = subprocess.run([sys.executable, "-c", program], check=False, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
