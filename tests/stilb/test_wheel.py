"""The package alone, as a field laptop has it: the wheel, what it needs, and nothing of the server."""

import os
import re
import subprocess
import sys
import venv
import zipfile
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from stilb.version import read_version
from tests.support.compose import ROOT

UV = Path(sys.executable).with_name("uv")
SERVER = ("numpy", "scipy", "cv2", "fastapi", "sqlalchemy", "service", "store", "worker", "radiometry")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run([UV, "build", "--quiet", "--offline", "--wheel", "--out-dir", folder, ROOT], check=True)
    (built,) = folder.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def laptop(wheel, tmp_path_factory):
    """An environment with the wheel and what follows from its own list of needs; no network is asked."""
    folder = tmp_path_factory.mktemp("laptop")
    venv.create(folder, symlinks=True)
    (packages,) = folder.glob("lib/python*/site-packages")
    for name in needs_of(wheel):
        link(metadata.distribution(name), packages)
    install = [UV, "pip", "install", "--quiet", "--offline", "--no-deps", "--python", folder / "bin/python"]
    subprocess.run([*install, wheel], check=True)
    return folder


def needs_of(wheel):
    """The wheel's requirements, and theirs, as they are installed here."""
    with zipfile.ZipFile(wheel) as archive:
        (path,) = [name for name in archive.namelist() if name.endswith("/METADATA")]
        text = archive.read(path).decode()
    ahead = [Requirement(line) for line in re.findall(r"^Requires-Dist: (.+)$", text, re.MULTILINE)]
    found: set[str] = set()
    while ahead:
        need = ahead.pop()
        name = canonicalize_name(need.name)
        if name in found or not holds(need):
            continue
        found.add(name)
        ahead += [Requirement(line) for line in metadata.requires(need.name) or ()]
    return found


def holds(need):
    return need.marker is None or need.marker.evaluate({"extra": ""})


def link(distribution, packages):
    """Its top level names, by links: a copy would take its time."""
    for name in {file.parts[0] for file in distribution.files if ".." not in file.parts} - {"__pycache__"}:
        (packages / name).symlink_to(distribution.locate_file(name))


def run(laptop, *command, **environment):
    clean = {name: value for name, value in os.environ.items() if not name.startswith(("STILB_", "PYTHON"))}
    return subprocess.run(
        [laptop / "bin" / command[0], *command[1:]],
        check=False,
        cwd=laptop,
        env=clean | {"XDG_CONFIG_HOME": str(laptop / "config")} | environment,
        capture_output=True,
        text=True,
        timeout=60,
    )


def test_the_wheel_holds_the_client_and_nothing_else(wheel):
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    assert {name.partition("/")[0] for name in names} == {"stilb", f"stilb-{read_version()}.dist-info"}
    assert "stilb/py.typed" in names
    ours = {f"{path.relative_to(ROOT)}" for path in (ROOT / "stilb").rglob("*.py")}
    assert ours <= set(names)


def test_it_runs_where_no_server_package_is(laptop, team):
    absent = f"import importlib.util as u; print([n for n in {SERVER!r} if u.find_spec(n)])"
    assert run(laptop, "python", "-c", absent).stdout == "[]\n"
    helped = run(laptop, "stilb", "--help")
    assert (helped.returncode, helped.stderr) == (0, "")
    assert "push" in helped.stdout
    asked = run(laptop, "stilb", "whoami", "--json", STILB_URL=team.url, STILB_KEY=team.key)
    assert asked.returncode == 0, asked.stderr
    assert '"name": "first"' in asked.stdout
    assert run(laptop, "python", "-m", "stilb", "k").returncode == 2


def test_a_shell_completes_commands_and_options(laptop):
    for typed, expected in (("stilb pu", {"push", "publish"}), ("stilb push --ca", {"--campaign"})):
        asked = {"_STILB_COMPLETE": "complete_bash", "COMP_WORDS": typed, "COMP_CWORD": str(typed.count(" "))}
        assert set(run(laptop, "stilb", **asked).stdout.split()) == expected
    # else it looks which shell started it, and tests are started by many
    named = {"_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"}
    assert "_STILB_COMPLETE" in run(laptop, "stilb", "--show-completion", "bash", **named).stdout
