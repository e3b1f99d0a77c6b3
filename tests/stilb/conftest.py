"""A service of a few lines on a real socket, which answers as told; and the real one, with a field team."""

import json
import socket
import struct
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, urlsplit

import pytest

import stilb
from stilb.commands.app import main
from tests.support.fieldwork import write_campaign
from tests.support.house import furnished
from tests.support.live import serving


@dataclass
class Asked:
    method: str
    path: str
    query: dict[str, str]
    headers: dict[str, str]
    body: bytes

    @property
    def json(self) -> Any:
        return json.loads(self.body)


@dataclass
class Answer:
    status: int = 200
    body: Any = field(default_factory=dict)
    headers: dict[str, str] = field(default_factory=dict)
    cut_after: int | None = None  # bytes of the request's body, after which the connection is reset
    withheld: int = 0  # bytes of the answer, at its end, that never come
    forget_body: bool = False  # where a test measures memory, of which this process holds both ends


class StandIn:
    """Answers in the order given; ``asked`` holds the whole requests, the cut ones as far as they came."""

    def __init__(self) -> None:
        self.asked: list[Asked] = []
        self._answers: list[Answer] = []
        self._lock = threading.Lock()
        self.url = ""

    def will_answer(self, body: Any = None, *, status: int = 200, **more: Any) -> None:
        self._answers.append(Answer(status=status, body={} if body is None else body, **more))

    def will_refuse(self, status: int, code: str, *, retryable: bool = False, **more: Any) -> None:
        headers = {"Content-Type": "application/problem+json", **more.pop("headers", {})}
        body = {"status": status, "code": code, "title": code, "retryable": retryable}
        body["detail"] = f"about {code}"
        self.will_answer({**body, **more}, status=status, headers=headers)

    def take(self) -> Answer:
        with self._lock:
            return self._answers.pop(0)

    @property
    def unsaid(self) -> int:
        return len(self._answers)


def _handler(stand_in: StandIn) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def _serve(self) -> None:
            answer = stand_in.take()
            length = int(self.headers.get("Content-Length", 0))
            body = self._read(length, answer)
            parts = urlsplit(self.path)
            query = {name: values[-1] for name, values in parse_qs(parts.query).items()}
            headers = {name.lower(): value for name, value in self.headers.items()}
            stand_in.asked.append(Asked(self.command, parts.path, query, headers, body))
            if answer.cut_after is not None:
                self._reset()
                return
            self._answer(answer)

        def _read(self, length: int, answer: Answer) -> bytes:
            if not answer.forget_body:
                return self.rfile.read(length if answer.cut_after is None else min(length, answer.cut_after))
            while length:
                length -= len(self.rfile.read(min(length, 1 << 16)))
            return b""

        def _answer(self, answer: Answer) -> None:
            data = answer.body if isinstance(answer.body, bytes) else json.dumps(answer.body).encode()
            data *= self.command != "HEAD" and answer.status != 204
            # `send_response` has a date of its own
            (self.send_response_only if "Date" in answer.headers else self.send_response)(answer.status)
            for name, value in {"Content-Type": "application/json", **answer.headers}.items():
                self.send_header(name, value)
            self.send_header("Content-Length", str(len(data) + answer.withheld))
            self.end_headers()
            self.wfile.write(data)
            self.close_connection |= answer.withheld > 0

        def _reset(self) -> None:
            # Linger 0: the close is a reset, as from a modem that lost its network.
            self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            self.connection.close()
            self.close_connection = True

        def log_message(self, *_: object) -> None:
            pass

        do_GET = do_HEAD = do_POST = do_PUT = do_PATCH = _serve  # noqa: N815  the base class's names

    return Handler


@pytest.fixture
def service() -> Iterator[StandIn]:
    stand_in = StandIn()
    server = ThreadingHTTPServer(("127.0.0.1", 0), _handler(stand_in))
    server.handle_error = lambda *_: None  # type: ignore[method-assign]  # cut connections are meant
    stand_in.url = f"http://127.0.0.1:{server.server_port}"
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    yield stand_in
    server.shutdown()
    thread.join()
    server.server_close()


@pytest.fixture
def client(service: StandIn) -> Iterator[stilb.Client]:
    with stilb.Client(service.url, "the-key", timeout=5, retries=3, backoff_s=0.001) as found:
        yield found


@pytest.fixture(scope="session")
def live(migrated_sqlite, tmp_path_factory):
    with furnished(migrated_sqlite, tmp_path_factory.mktemp("live")) as house, serving(house) as served:
        yield served


@pytest.fixture
def team(live):
    with live.team(retries=1) as founded:
        yield founded


@pytest.fixture(scope="session")
def shots(tmp_path_factory):
    """Thirty frames of a campaign, to be sorted into a card's folders."""
    return write_campaign(tmp_path_factory.mktemp("shots"))


@dataclass(frozen=True)
class Ended:
    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        return json.loads(self.out)


@pytest.fixture
def config(monkeypatch, tmp_path):
    """A person who has never signed in."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.delenv("STILB_URL", raising=False)
    monkeypatch.delenv("STILB_KEY", raising=False)
    return tmp_path / "config" / "stilb"


@pytest.fixture
def stilb_command(config, capsys):  # noqa: ARG001  nobody's own login is touched
    """Run the command as a person does, and give its end."""

    def run(*arguments: object) -> Ended:
        capsys.readouterr()
        code = main([str(each) for each in arguments])
        return Ended(code, *capsys.readouterr())

    return run


@pytest.fixture
def signed_in(stilb_command, team):
    ended = stilb_command("login", team.url, "--key", team.key)
    assert ended.code == 0, ended.err
    return stilb_command
