"""The house on a real socket, with a worker that looks for work whenever it is hinted at."""

import queue
import socket
import threading
from collections.abc import Sequence
from contextlib import contextmanager

import uvicorn

from store.jobs.queues import Message
from tests.support.fieldwork import Team, new_team
from tests.support.house import KEY, House


class _Post:
    """Carries messages to the worker of the same process."""

    def __init__(self):
        self.waiting: queue.Queue[Message | None] = queue.Queue()

    def send(self, messages: Sequence[Message]) -> None:
        for message in messages:
            self.waiting.put(message)


class Live:
    """Where it answers; `team` founds an organisation of one test's own."""

    def __init__(self, house: House, url: str):
        self.house = house
        self.url = url

    def team(self, **settings) -> Team:
        return new_team(self.url, KEY, **settings)


@contextmanager
def serving(house: House):
    """Serve a house over loopback until the block ends."""
    post = house.database.post = _Post()
    # What connects before it serves waits in the socket's queue.
    listening = socket.create_server(("127.0.0.1", 0))
    config = uvicorn.Config(house.app, log_config=None, lifespan="off", timeout_graceful_shutdown=1)
    server = uvicorn.Server(config)

    def work() -> None:
        while post.waiting.get() is not None:
            house.work()

    threads = [
        threading.Thread(target=server.run, kwargs={"sockets": [listening]}),
        threading.Thread(target=work),
    ]
    for thread in threads:
        thread.start()
    try:
        yield Live(house, f"http://127.0.0.1:{listening.getsockname()[1]}")
    finally:
        server.should_exit = True
        post.waiting.put(None)
        for thread in threads:
            thread.join()
        listening.close()
        house.database.post = None
