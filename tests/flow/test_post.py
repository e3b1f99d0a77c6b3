"""Whoever sends messages is never held up by a broker that does not answer."""

import socket
import threading
from contextlib import contextmanager

import pytest

from store.jobs.queues import LANES, QUEUES, Message, Post
from tests.support.broker import own_broker
from tests.support.deployments import short_folder
from tests.support.processes import wait_until

MESSAGES = [Message(LANES["extract"], f"job_{number}", f"frm_{number}") for number in range(2)]


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
    "answers", [pytest.param(socket.socket.fileno, id="silent"), pytest.param(socket.socket.close, id="gone")]
)
def test_one_attempt_for_all_who_send_at_once(answers):
    with broker_that(answers) as (url, taken):
        post = Post(url)
        senders = [threading.Thread(target=post.send, args=[MESSAGES], daemon=True) for _ in range(20)]
        for sender in senders:
            sender.start()
        wait_until(lambda: not any(sender.is_alive() for sender in senders))
        assert len(taken) == 1
        assert post.count() is None


def test_messages_are_counted_also_after_the_broker_has_forgotten_everything():
    with short_folder() as folder, own_broker(folder) as (url, broker, _):
        post = Post(url)
        for _ in range(2):
            post.send(MESSAGES)
            assert post.count() == dict.fromkeys(QUEUES, 0) | {"frames": 2}
            broker.flushall()
        assert post.count() == dict.fromkeys(QUEUES, 0)
