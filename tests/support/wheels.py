"""Both wheels, and an environment with them; no network is asked."""

import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

from tests.support.compose import ROOT, load_script
from tests.support.printed import read_blocks, type_in

UV = Path(sys.executable).with_name("uv")


@pytest.fixture(scope="session")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run([UV, "build", "--quiet", "--offline", "--wheel", "--out-dir", folder, ROOT], check=True)
    (built,) = folder.glob("*.whl")
    return built


@pytest.fixture(scope="session")
def server_wheel(tmp_path_factory):
    return load_script("server_wheel").build(ROOT, tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="session")
def installed(wheel, server_wheel, tmp_path_factory):
    """An environment with both wheels, made as the pages say; what they need is found in this one."""
    folder = tmp_path_factory.mktemp("installed")
    (folder / "dist").mkdir()
    for built in (wheel, server_wheel):
        (folder / "dist" / built.name).symlink_to(built)
    made, up = read_blocks("docs/install.md")[0].rsplit("\n", 2)[:2]
    assert up == "stilb-env/bin/stilb-server up"
    type_in(folder, made)
    environment = folder / "stilb-env"
    client, _ = read_blocks("docs/command-line.md")[0].splitlines()
    type_in(folder, client, first=environment / "bin")
    (packages,) = environment.glob("lib/python*/site-packages")
    (packages / "needs.pth").write_text(sysconfig.get_path("purelib"))
    return environment
