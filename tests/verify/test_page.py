"""What docs/certificate.md says is so: its commands work word for word."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.certificates import complete_version
from tests.support.house import KEY

pytestmark = pytest.mark.either_database

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "certificate.md").read_text(encoding="utf-8")


@pytest.mark.skipif(shutil.which("curl") is None, reason="a command is curl's")
def test_its_commands_work(staged, address, tmp_path):
    version = staged(complete_version)
    (block,) = re.findall(r"^```sh\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    environment = os.environ | {
        "HOME": str(tmp_path),
        "STILB": address,
        "KEY": KEY,
        "CAL": version["id"],
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
        "MAKEFLAGS": "-o .venv/run",  # the environment that runs the tests is the one to use
    }
    done = subprocess.run(
        ["sh", "-euc", block],
        check=False,
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    assert done.stdout.count("the same to the last bit") == 2
    assert (tmp_path / "certificate.pdf").read_bytes().startswith(b"%PDF")
