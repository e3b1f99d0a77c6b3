"""The house on a real socket, with a worker that looks for work whenever it is hinted at."""

import queue
import socket
import threading
from contextlib import contextmanager
from dataclasses import replace

import uvicorn

from tests.support.fieldwork import Team, new_team
from tests.support.house import KEY, House


class _QueuedHints:
    def __init__(self):
        self.waiting: queue.Queue[str | None] = queue.Queue()

    def send(self, job_ids: list[str]) -> None:
        for job_id in job_ids:
            self.waiting.put(job_id)


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
    hints = _QueuedHints()
    house.app.state.context = replace(house.app.state.context, hints=hints)
    # What connects before it serves waits in the socket's queue.
    listening = socket.create_server(("127.0.0.1", 0))
    config = uvicorn.Config(house.app, log_config=None, lifespan="off", timeout_graceful_shutdown=1)
    server = uvicorn.Server(config)

    def work() -> None:
        while hints.waiting.get() is not None:
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
        hints.waiting.put(None)
        for thread in threads:
            thread.join()
        listening.close()
