"""Both wheels, and an environment with them; no network is asked."""

import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

import pytest

from tests.support.compose import ROOT, load_script

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
    """An environment with both wheels; what they need is found in this one."""
    folder = tmp_path_factory.mktemp("installed")
    venv.create(folder, symlinks=True)
    (packages,) = folder.glob("lib/python*/site-packages")
    (packages / "needs.pth").write_text(sysconfig.get_path("purelib"))
    install = [UV, "pip", "install", "-q", "--offline", "--no-deps", "--python", folder / "bin" / "python"]
    subprocess.run([*install, wheel, server_wheel], check=True)
    return folder
