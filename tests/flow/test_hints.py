"""Whoever sends hints is never held up by a broker that does not answer."""

import os
import socket
import subprocess
import threading
from contextlib import contextmanager

import pytest
import redis

from service.launch.valkey import valkey_binary, valkey_command
from store.broker import MOST_HINTS, Hints
from tests.support.deployments import spawn
from tests.support.processes import wait_until


@contextmanager
def broker_that(answers):
    """A port where every connection is taken and treated so; the list grows with each."""
    taken = []

    def serve():
        while True:
            try:
                connection, _ = server.accept()
            except OSError:
                return
            taken.append(connection)
            answers(connection)

    with socket.create_server(("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield f"redis://127.0.0.1:{server.getsockname()[1]}/0", taken
        finally:
            server.shutdown(socket.SHUT_RDWR)
            thread.join()
            for connection in taken:
                connection.close()


@pytest.mark.parametrize(
    "answers",
    [pytest.param(socket.socket.fileno, id="silent"), pytest.param(socket.socket.close, id="gone")],
)
def test_one_attempt_for_all_who_send_at_once(answers):
    with broker_that(answers) as (url, taken):
        hints = Hints(url)
        jobs = [["job_1", "job_2"]]
        senders = [threading.Thread(target=hints.send, args=jobs, daemon=True) for _ in range(20)]
        for sender in senders:
            sender.start()
        wait_until(lambda: not any(sender.is_alive() for sender in senders))
        assert len(taken) == 1


@contextmanager
def own_broker(folder):
    sock = folder / "valkey.sock"
    command = valkey_command(valkey_binary(), folder, sock)
    with spawn(command, dict(os.environ), stdout=subprocess.DEVNULL) as process:
        try:
            with redis.Redis(unix_socket_path=str(sock)) as broker:
                wait_until(lambda: sock.exists() and broker.ping())
                yield f"redis+socket://{sock}", broker
        finally:
            process.terminate()


def test_hints_do_not_pile_up_where_no_worker_takes_them(tmp_path):
    with own_broker(tmp_path) as (url, broker):
        hints = Hints(url)
        for number in range(3 * MOST_HINTS):
            hints.send([f"job_{number}", f"job_{number}b"])
        assert broker.llen("celery") == MOST_HINTS
        broker.lpop("celery")
        hints.send(["job_last"])
        assert broker.llen("celery") == MOST_HINTS
