"""The proxy does to a connection what it says."""

import socket
import threading
import time
from contextlib import suppress

import pytest

from tests.support.proxy import SLOW_S, Proxy


@pytest.fixture
def proxy():
    """Before a server that answers what it is told."""

    def echo(connection: socket.socket) -> None:
        with connection, suppress(ConnectionError):
            while text := connection.recv(100):
                connection.sendall(text)

    def serve() -> None:
        while True:
            try:
                connection, _ = server.accept()
            except OSError:
                return
            threading.Thread(target=echo, args=(connection,), daemon=True).start()

    with socket.create_server(("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=serve)
        thread.start()
        with Proxy(server.getsockname(), failure=b"busy") as proxy:
            yield proxy
        server.shutdown(socket.SHUT_RDWR)
        thread.join()


def connect(proxy):
    return socket.create_connection(("127.0.0.1", proxy.port), timeout=5)


def say(connection, text=b"hello"):
    connection.sendall(text)
    return connection.recv(100)


def test_it_passes_on(proxy):
    with connect(proxy) as connection:
        assert (say(connection), say(connection, b"again"), proxy.struck) == (b"hello", b"again", 0)


def test_silence_swallows_and_forgets(proxy):
    with connect(proxy) as old:
        assert say(old) == b"hello"
        with proxy.being("silent"), connect(proxy) as new:
            for each in (old, new):
                each.settimeout(0.2)
                with pytest.raises(TimeoutError):
                    say(each)
            assert proxy.struck == 2
        old.settimeout(5)
        with pytest.raises(ConnectionError):
            old.recv(1)
    with connect(proxy) as connection:
        assert say(connection) == b"hello"


def test_slowness_delays(proxy):
    with connect(proxy) as connection, proxy.being("slow"):
        started = time.monotonic()
        assert say(connection) == b"hello"
        assert time.monotonic() - started >= 2 * SLOW_S
        assert proxy.struck >= 2


def test_failure_answers_its_own_words(proxy):
    with proxy.being("failing"), connect(proxy) as connection:
        assert say(connection) == b"busy"
        assert proxy.struck == 1


def test_away_refuses_and_cuts(proxy):
    with connect(proxy) as old:
        assert say(old) == b"hello"
        with proxy.being("away"):
            with pytest.raises(ConnectionError):
                old.recv(1)
            with pytest.raises(ConnectionRefusedError):
                connect(proxy)
            assert proxy.struck >= 1
    with connect(proxy) as connection:
        assert say(connection) == b"hello"
