"""A line between client and service that can be cut."""

import socket
import struct
import threading
from contextlib import contextmanager

_RESET = struct.pack("ii", 1, 0)  # linger 0: the close is a reset, as from a modem that lost its network


class Line:
    """Passes bytes on. ``cut_after`` counts those of the client, once: then every connection is reset."""

    def __init__(self, host: str, port: int):
        self._to = (host, port)
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self._listening.getsockname()[1]}"
        self.cut_after: int | None = None
        self.cuts = 0
        self._passed = 0

    def serve(self) -> None:
        while True:
            try:
                client, _ = self._listening.accept()
            except OSError:
                return
            service = socket.create_connection(self._to)
            for one, other in ((client, service), (service, client)):
                pair = {"one": one, "other": other, "counts": one is client}
                threading.Thread(target=self._pass, kwargs=pair, daemon=True).start()

    def _pass(self, *, one: socket.socket, other: socket.socket, counts: bool) -> None:
        try:
            while chunk := one.recv(65536):
                self._passed += len(chunk) if counts else 0
                if self.cut_after is not None and self._passed > self.cut_after:
                    self.cut_after, self.cuts = None, self.cuts + 1
                    break
                other.sendall(chunk)
            else:
                other.shutdown(socket.SHUT_WR)
                return
        except OSError:
            pass
        for each in (one, other):
            each.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESET)
            each.close()

    def close(self) -> None:
        self._listening.shutdown(socket.SHUT_RDWR)
        self._listening.close()


@contextmanager
def line_to(url: str):
    """A line to a service, as long as the block."""
    host, port = url.removeprefix("http://").split(":")
    line = Line(host, int(port))
    thread = threading.Thread(target=line.serve)
    thread.start()
    yield line
    line.close()
    thread.join()
