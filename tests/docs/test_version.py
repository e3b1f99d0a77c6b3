"""One version number for the product, and one of its own for the code that fits."""

import tomllib

from stilb import transport
from stilb.commands.app import main
from store import software
from store.fits import hash_content
from tests.support.compose import ROOT


def stated():
    return tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]


def test_client_and_service_state_the_version_of_pyproject(capsys):
    assert main(["--version"]) == 0
    assert {software.read_version(), transport.read_version(), capsys.readouterr().out.strip()} == {stated()}


def test_installed_client_states_the_version_of_its_package(monkeypatch, tmp_path):
    monkeypatch.setattr(transport, "__file__", str(tmp_path / "stilb" / "version.py"))
    monkeypatch.setattr(transport.metadata, "version", lambda name: {"stilb": "7.8.9"}[name])
    (tmp_path / "pyproject.toml").write_text('[project]\nname = "other"\nversion = "1"\n')
    assert transport.read_version.__wrapped__() == "7.8.9"


def test_content_hashes_are_those_of_the_stored_versions():
    """A release keeps the fit code version as long as it fits as before."""
    assert software.FIT_CODE_VERSION == "0.1.21"
    expected = "440dfeae9f98b20081a1cf298b5be1bb0471433488e2e4e88c36ffbf275805b8"
    assert hash_content({"frames": []}, {"model": "proportional"}) == expected
