"""The code that README and docs print, and a folder in which it is typed."""

import os
import re
import subprocess
import sys
from pathlib import Path

from tests.support.compose import ROOT

SHOWN_CHARS = 3000
NO_CURL = "there is no curl: apt-get install curl"


def read_blocks(page: str, language: str = "sh") -> list[str]:
    """Return the fenced blocks of a page in this language, in their order."""
    text = (ROOT / page).read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def link_checkout(folder: Path) -> None:
    """Make a folder look like this checkout to `make`, with the environment of these tests up to date."""
    for path in ROOT.iterdir():
        if path.name not in {".venv", "stilb-data", "build", "dist"}:
            (folder / path.name).symlink_to(path)
    (folder / ".venv").mkdir()
    for path in Path(sys.prefix).iterdir():
        (folder / ".venv" / path.name).symlink_to(path)
    for stamp in ("uv", "run", "dev"):
        (folder / ".venv" / stamp).unlink(missing_ok=True)
        (folder / ".venv" / stamp).touch()


def type_in(folder: Path, commands: str, *, first: Path | None = None, **variables: str) -> str:
    """Run commands in a shell, and return what they print; all must succeed.

    Programs are found in ``first``, then `stilb` of this checkout, then those beside these tests' Python.
    package index is asked, and curl shows nothing but answers and errors.
    """
    home = folder / "home"
    home.mkdir(exist_ok=True)
    (home / ".curlrc").write_text("silent\nshow-error\nfail-with-body\n")
    program = home / "bin" / "stilb"
    program.parent.mkdir(exist_ok=True)
    program.write_text(f'#!/bin/sh\nPYTHONPATH={ROOT} exec {sys.executable} -m stilb "$@"\n')
    program.chmod(0o755)
    path = [str(each) for each in (first, program.parent, Path(sys.executable).parent) if each]
    own = {"PIP_NO_INDEX": "1", "PIP_NO_DEPS": "1", "HOME": str(home)}
    clean = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith(("STILB_", "XDG_", "MAKE", "MFLAGS"))
    }
    done = subprocess.run(
        ["bash", "-euc", commands],
        check=False,
        cwd=folder,
        env=clean | own | variables | {"PATH": os.pathsep.join([*path, os.environ["PATH"]])},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout[-SHOWN_CHARS:] + done.stderr[-SHOWN_CHARS:]
    return done.stdout
