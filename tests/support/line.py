"""A line between client and service that can be cut."""

import socket
import struct
import threading
from contextlib import contextmanager, suppress

_RESET = struct.pack("ii", 1, 0)  # linger 0: the close is a reset, as from a modem that lost its network


class Line:
    """Passes bytes on. ``cut_after`` counts those of the client, once: then their connection is reset.

    With ``stays_cut`` so is every other that says something, until ``cut_after`` is None again.
    """

    def __init__(self, host: str, port: int):
        self._to = (host, port)
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self._listening.getsockname()[1]}"
        self.cut_after: int | None = None
        self.stays_cut = False
        self.cuts = 0
        self.passed = 0

    def serve(self) -> None:
        carriers = []
        with suppress(OSError):  # the line was closed
            while True:
                client, _ = self._listening.accept()
                carriers.append(threading.Thread(target=self._carry, args=(client,)))
                carriers[-1].start()
        for carrier in carriers:
            carrier.join()

    def close(self) -> None:
        self._listening.shutdown(socket.SHUT_RDWR)
        self._listening.close()

    def _carry(self, client: socket.socket) -> None:
        with client, socket.create_connection(self._to) as service:
            back = threading.Thread(target=self._answer, args=(service, client))
            back.start()
            self._ask(client, service)
            back.join()

    def _ask(self, client: socket.socket, service: socket.socket) -> None:
        with suppress(OSError):
            while chunk := client.recv(65536):
                self.passed += len(chunk)
                if self._breaks():
                    client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESET)
                    break
                service.sendall(chunk)
        _end(service)

    def _breaks(self) -> bool:
        if self.cut_after is None or self.passed <= self.cut_after:
            return False
        self.cuts += 1
        if not self.stays_cut:
            self.cut_after = None
        return True

    def _answer(self, service: socket.socket, client: socket.socket) -> None:
        with suppress(OSError):
            while chunk := service.recv(65536):
                client.sendall(chunk)
        _end(client)


def _end(side: socket.socket) -> None:
    with suppress(OSError):
        side.shutdown(socket.SHUT_RDWR)


@contextmanager
def line_to(url: str):
    """A line to a service, as long as the block; one that a failure left would keep pytest from ending."""
    host, port = url.removeprefix("http://").split(":")
    line = Line(host, int(port))
    thread = threading.Thread(target=line.serve)
    thread.start()
    try:
        yield line
    finally:
        line.close()
        thread.join()
