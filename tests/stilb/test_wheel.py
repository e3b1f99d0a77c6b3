"""The package alone, as a field laptop has it: the wheel, what it needs, and nothing of the server."""

import email
import os
import pty
import re
import shutil
import subprocess
import sys
import termios
import venv
import zipfile
from contextlib import suppress
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from stilb.commands.output import Login, keep_login
from stilb.transport import read_version
from tests.support.compose import ROOT
from tests.support.processes import wait_until

UV = Path(sys.executable).with_name("uv")
SERVER = ("numpy", "scipy", "cv2", "fastapi", "sqlalchemy", "service", "store", "worker", "radiometry")


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
    )


def test_the_wheel_holds_the_client_and_nothing_else(wheel):
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        (path,) = [name for name in names if name.endswith("/METADATA")]
        stated = email.message_from_bytes(archive.read(path))
    assert {name.partition("/")[0] for name in names} == {"stilb", f"stilb-{read_version()}.dist-info"}
    ours = {f"{path.relative_to(ROOT)}" for path in (ROOT / "stilb").rglob("*.py")}
    assert ours | {"stilb/py.typed"} <= set(names)
    assert "authors" in stated["Author"]
    assert "Typing :: Typed" in stated.get_all("Classifier")
    # an extra that brings no code of its own would promise it
    assert stated.get_all("Provides-Extra") is None
    assert not re.search(r"\]\((?!https?:)", stated.get_payload())  # no link that leads nowhere outside


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


TYPED = {
    "stilb calibrate Ri\t--model prop\t": "stilb calibrate Ring-Road --model proportional",
    "stilb push . --role da\t": "stilb push . --role dark",
}


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_tab_key_completes_in_a_real_shell(laptop, team, tmp_path, shell):
    if shutil.which(shell) is None:
        pytest.skip(f"there is no {shell} here")
    campaign = team.campaign()
    team.client.change_campaign(campaign.id, project_number="Ring-Road")
    home = {"HOME": str(tmp_path), "PATH": f"{laptop / 'bin'}:{os.environ['PATH']}", "TERM": "xterm"}
    (login := tmp_path / ".config/stilb").mkdir(parents=True)
    keep_login(login, Login(url=team.url, key=team.key))
    # it looks which shell has started it, and writes what that shell reads when it starts
    install = [shell, "-c", "stilb --install-completion; true"]
    assert "installed" in subprocess.run(install, env=home, check=True, capture_output=True, text=True).stdout
    # in zsh the first one only loads it: https://github.com/pallets/click/issues/2344
    begins = "stilb \t\x15" if shell == "zsh" else ""
    for line in [*TYPED] if shell == "bash" else [*TYPED][:1]:
        keys = f"{begins}{line}\x01exec echo \r"
        said = type_into([shell, "-i"], home, tmp_path, keys)
        assert f"\n{TYPED[line]}" in said.replace("\r", "\n"), said


def type_into(command, environment, folder, keys):
    """Type as soon as the shell reads a terminal key by key; return what it shows until it ends."""
    pid, terminal = pty.fork()
    if pid == 0:
        os.chdir(folder)
        os.execvpe(command[0], command, environment)
    wait_until(lambda: not termios.tcgetattr(terminal)[3] & termios.ICANON, timeout_s=60)
    shown = b""
    with os.fdopen(terminal, "r+b", buffering=0) as screen, suppress(OSError):  # it ends in an error
        screen.write(keys.encode())
        while chunk := screen.read(65536):
            shown += chunk
    os.waitpid(pid, 0)
    return shown.decode(errors="replace")
