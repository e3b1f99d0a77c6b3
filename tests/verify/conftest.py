"""One export of a small version, made once and copied for each test; a house that answers on a socket."""

import shutil
import socket
import threading
from contextlib import nullcontext

import pytest
import uvicorn

from tests.support.certificates import complete_version, export_version
from tests.support.house import DECODERS, furnished


@pytest.fixture(autouse=True)
def verifying(monkeypatch):
    """Wide tables, and decoders that are started once; the installed command starts its own."""
    monkeypatch.setenv("COLUMNS", "250")
    monkeypatch.setattr("verify.__main__.DecoderPool", lambda: nullcontext(DECODERS))


@pytest.fixture(scope="session")
def exported_once(migrated_sqlite, tmp_path_factory):
    folder = tmp_path_factory.mktemp("verify")
    with furnished(migrated_sqlite, folder) as house:
        return export_version(house, complete_version(house), folder / "export")


@pytest.fixture
def exported(exported_once, tmp_path):
    return shutil.copytree(exported_once, tmp_path / "export")


@pytest.fixture
def address(house):
    """The house on a port: what connects before it serves waits in the socket's queue."""
    listening = socket.create_server(("127.0.0.1", 0))
    server = uvicorn.Server(uvicorn.Config(house.app, log_config=None, lifespan="off"))
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]})
    thread.start()
    yield f"http://127.0.0.1:{listening.getsockname()[1]}"
    server.should_exit = True
    thread.join()
    listening.close()
