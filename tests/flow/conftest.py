"""One service of each kind for all tests that leave it as they found it, and the figures of a quiet run."""

import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

import pytest

from tests.support.compose import ROOT, load_script
from tests.support.deployments import Composed, Embedded, short_folder
from tests.support.fieldwork import figures_of, write_campaign


@pytest.fixture(scope="session")
def server_wheel(tmp_path_factory):
    return load_script("server_wheel").build(ROOT, tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="session")
def installed(server_wheel, tmp_path_factory):
    """An environment with the server's wheel; what it needs is found in this one, and no network is asked."""
    folder = tmp_path_factory.mktemp("installed")
    venv.create(folder, symlinks=True)
    (packages,) = folder.glob("lib/python*/site-packages")
    (packages / "needs.pth").write_text(sysconfig.get_path("purelib"))
    uv, python = Path(sys.executable).with_name("uv"), folder / "bin" / "python"
    install = [uv, "pip", "install", "-q", "--offline", "--no-deps", "--python", python, server_wheel]
    subprocess.run(install, check=True)
    return folder


@pytest.fixture(scope="session")
def embedded(installed):
    """`stilb-server up` from its wheel, on SQLite, a folder and the bundled Valkey."""
    command = [str(installed / "bin" / "stilb-server"), "up"]
    with short_folder() as folder, Embedded(folder / "data", command) as deployment:
        yield deployment


@pytest.fixture(scope="session")
def composed(postgres):
    """docker-compose.yml, on PostgreSQL, S3 and a Valkey of its own."""
    with short_folder() as folder, Composed(folder, postgres.new_database()) as deployment:
        yield deployment


@pytest.fixture(params=["embedded", "composed"])
def deployment(request):
    return request.getfixturevalue(request.param)


@pytest.fixture(scope="session")
def shots(tmp_path_factory):
    """Thirty frames, of which K follows at two ISO values."""
    return write_campaign(tmp_path_factory.mktemp("shots"))


@pytest.fixture(scope="session")
def quiet_figures(embedded, shots):
    """What comes of the campaign when nothing disturbs: all other ways must end the same, to the last bit."""
    with embedded.team() as team:
        campaign = team.campaign()
        frames = team.push(campaign, shots)
        embedded.wait_for_jobs([frame.id for frame in frames])
        return figures_of(team.client.calibrate(campaign.id))
