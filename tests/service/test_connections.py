"""Idle half-requests, by the hundred, on real sockets: they keep nobody else from an answer."""

import socket
import subprocess
import sys
import time
from contextlib import ExitStack, contextmanager
from types import SimpleNamespace

import httpx
import pytest

from service.http.connections import Connections, _Joining

HALF = b"GET /livez HTTP/1.1\r\nHost: x\r\nX-Slow: "
FILES = 256
SERVER = """
import resource, socket, sys, uvicorn
from service.http.connections import Connections, guarding, raise_file_limit

files, per_peer, headers_within_s, guarded = map(float, sys.argv[1:])
resource.setrlimit(resource.RLIMIT_NOFILE, (int(files) // 2, int(files)))

async def app(scope, receive, send):
    size, more = 0, scope["type"] == "http"
    while more:
        message = await receive()
        size, more = size + len(message.get("body", b"")), message.get("more_body", False)
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": str(size).encode()})

config = uvicorn.Config(app, log_config=None, lifespan="off")
if guarded:
    config.http = guarding(
        Connections(files=raise_file_limit(), per_peer=int(per_peer), headers_within_s=headers_within_s)
    )
listening = socket.create_server(("127.0.0.1", 0), backlog=1000)
print(listening.getsockname()[1], flush=True)
uvicorn.Server(config).run(sockets=[listening])
"""


@contextmanager
def serving(*, per_peer=0, headers_within_s=60.0, guarded=True):
    arguments = [str(float(value)) for value in (FILES, per_peer, headers_within_s, guarded)]
    with subprocess.Popen([sys.executable, "-c", SERVER, *arguments], stdout=subprocess.PIPE) as process:
        try:
            yield int(process.stdout.readline())
        finally:
            process.kill()


@pytest.fixture(scope="module")
def default():
    with serving() as port:
        yield port


@pytest.fixture(scope="module")
def quick():
    with serving(headers_within_s=1.0) as port:
        yield port


def connect(stack, port, *, peer="127.0.0.1"):
    return stack.enter_context(
        socket.create_connection(("127.0.0.1", port), timeout=20, source_address=(peer, 0))
    )


def send_halves(stack, port, number):
    connections = [connect(stack, port) for _ in range(number)]
    for connection in connections:
        connection.sendall(HALF)
    return connections


def answers(port, *, peer="127.0.0.2", within_s=10.0):
    transport = httpx.HTTPTransport(local_address=peer)
    with httpx.Client(transport=transport, timeout=within_s) as http:
        try:
            return http.get(f"http://127.0.0.1:{port}/").status_code == 200
        except httpx.TransportError:
            return False


def is_closed(connection, *, within_s=20.0):
    connection.settimeout(within_s)
    try:
        return connection.recv(1) == b""
    except ConnectionResetError:
        return True
    except TimeoutError:
        return False


@pytest.mark.parametrize("guarded", [False, True])
def test_one_peer_with_more_than_the_process_may_open_keeps_nobody_else_out(guarded):
    """Without the guard it does: the test can fail."""
    with serving(per_peer=50, guarded=guarded) as port, ExitStack() as stack:
        halves = send_halves(stack, port, FILES + 50)
        assert answers(port, within_s=10.0 if guarded else 2.0) is guarded
        if guarded:
            assert is_closed(halves[-1])
            assert not is_closed(halves[0], within_s=0.2)


def test_half_a_request_is_ended_in_time_and_a_whole_one_is_not(quick):
    with ExitStack() as stack:
        halves = send_halves(stack, quick, 100)
        silent, again = connect(stack, quick), connect(stack, quick)
        again.sendall(HALF + b"\r\n\r\n")
        answer = b""
        while not answer.endswith(b"0\r\n\r\n"):
            answer += again.recv(1000)
        again.sendall(HALF)
        begun = time.monotonic()
        assert all(is_closed(connection) for connection in (*halves, silent, again))
        assert time.monotonic() - begun < 120
        assert answers(quick, peer="127.0.0.1")


def test_a_slow_body_lives_on(quick):
    with ExitStack() as stack:
        connection = connect(stack, quick)
        connection.sendall(b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 13\r\n\r\n")
        for _ in range(13):
            time.sleep(0.1)
            connection.sendall(b"x")
        assert connection.recv(1000).startswith(b"HTTP/1.1 200")


def test_headers_without_end_are_cut(default):
    with ExitStack() as stack:
        connection = connect(stack, default)
        connection.sendall(b"GET / HTTP/1.1\r\n")
        for _ in range(1000):
            try:
                connection.sendall(b"X-More: " + b"x" * 1000 + b"\r\n")
            except OSError:
                return
            time.sleep(0.001)
        pytest.fail("a megabyte of headers was taken")


@pytest.mark.parametrize(("size", "status"), [(60_000, b"200"), (70_000, b"400")])
def test_headers_that_come_at_once_have_the_same_limit(default, size, status):
    with ExitStack() as stack:
        connection = connect(stack, default)
        connection.sendall(b"GET / HTTP/1.1\r\nHost: x\r\nX-More: " + b"x" * size + b"\r\n\r\n")
        assert connection.recv(1000).startswith(b"HTTP/1.1 " + status)


def test_who_left_makes_room():
    with serving(per_peer=3) as port:
        for _ in range(5):
            with ExitStack() as stack:
                send_halves(stack, port, 3)
                assert not answers(port, peer="127.0.0.1", within_s=2.0)
            deadline = time.monotonic() + 10
            while not answers(port, peer="127.0.0.1"):
                assert time.monotonic() < deadline, "nobody made room"


def test_head_of_an_answer_goes_with_its_body_and_never_waits():
    sent, turns = [], []
    transport = SimpleNamespace(write=sent.append, close=lambda: sent.append("closed"))
    joining = _Joining(transport, SimpleNamespace(call_soon=turns.append))
    head, long = b"HTTP/1.1 200 OK\r\n\r\n", bytes(1 << 16)
    for piece in (head, b"{}", head, long, b"more", head):
        joining.write(piece)
    assert sent == [head + b"{}", head, long, b"more"]
    for turn in turns:
        turn()
    assert sent[4:] == [head]
    joining.write(head)
    joining.close()
    assert sent[5:] == [head, "closed"]


def test_an_address_that_has_enough_is_told_once(caplog):
    connections = Connections(files=FILES, per_peer=2, headers_within_s=1.0)
    assert [connections.admit("a") for _ in range(4)] == [True, True, False, False]
    assert caplog.messages == ["no more connections are taken from a, which has 2"]
    for _ in range(2):
        connections.release("a")
    assert [connections.admit("a") for _ in range(3)] == [True, True, False]
    assert len(caplog.messages) == 2
