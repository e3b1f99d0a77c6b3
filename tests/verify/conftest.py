"""One house on a port, whose exports are made once and copied by the tests that change something."""

import shutil
import socket
import threading
from contextlib import nullcontext

import pytest
import uvicorn

from stilb.export import export_measurement
from tests.support.certificates import InHouse, complete_version, export_version
from tests.support.every_method import make_version
from tests.support.house import DECODERS, furnished


@pytest.fixture(autouse=True)
def verifying(monkeypatch):
    """Wide tables, and decoders that are started once; the installed command starts its own."""
    monkeypatch.setenv("COLUMNS", "250")
    monkeypatch.setattr("verify.__main__.DecoderPool", lambda: nullcontext(DECODERS))


class Exports:
    """Versions of each method and their exports, made when a test first asks for them."""

    def __init__(self, house, folder):
        self.house = house
        self._folder = folder
        self._versions = {}

    def version(self, method):
        if method not in self._versions:
            make = make_version if method != "luminance" else lambda house, _: complete_version(house)
            self._versions[method] = make(self.house, method)
            export_version(self.house, self._versions[method], self._folder / method)
        return self._versions[method]

    def of(self, method):
        self.version(method)
        return self._folder / method

    def of_measurement(self, name, method, frames, **asked):
        """Measure frames with that method's version, with a map."""
        folder = self._folder / f"measured-{name}"
        if not folder.exists():
            ids = [frame["id"] for frame in frames]
            named = {"frame_ids": ids} if len(ids) > 1 else {"frame_id": ids[0]}
            body = {**named, "calibration_id": self.version(method)["id"], "products": ["map"], **asked}
            export_measurement(InHouse(self.house), self.house.measure(**body)["id"], folder)
        return folder


@pytest.fixture(scope="session")
def exports(migrated_sqlite, tmp_path_factory):
    folder = tmp_path_factory.mktemp("verify")
    with furnished(migrated_sqlite, folder) as house:
        yield Exports(house, folder / "exports")


@pytest.fixture
def exported(exports, tmp_path):
    return shutil.copytree(exports.of("luminance"), tmp_path / "export")


@pytest.fixture(scope="session")
def address(exports):
    """The house on a port: what connects before it serves waits in the socket's queue."""
    listening = socket.create_server(("127.0.0.1", 0))
    server = uvicorn.Server(uvicorn.Config(exports.house.app, log_config=None, lifespan="off"))
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]})
    thread.start()
    yield f"http://127.0.0.1:{listening.getsockname()[1]}"
    server.should_exit = True
    thread.join()
    listening.close()
