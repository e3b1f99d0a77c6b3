"""A peer on the network that can fall silent, become slow, fail or go away: a proxy on loopback."""

import asyncio
import socket
import threading
import time
from collections import deque
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Literal

Mode = Literal["open", "silent", "slow", "failing", "away"]
SLOW_S = 0.2
"""How much later each piece of what a slow peer says comes."""
_MOST_READ = 65536
_HEAD_BYTES = 1500
_TICK_S = 0.05
_RESET = (1).to_bytes(4, "little") + bytes(4)  # linger 0: the close is a reset


class Proxy:
    """Passes bytes on to a server while ``open``.

    ``silent``: nothing passes, either way, and nothing is refused, as behind a firewall that drops packets.
    ``slow``: each piece comes ``SLOW_S`` later. ``failing``: every connection that says something gets
    ``failure`` and its end; a reset where that is empty. ``away``: connections are refused, open ones reset.
    ``struck`` counts what was swallowed, delayed, failed or cut. ``rate`` [bytes/s] is that of each
    connection and direction; ``passed`` counts bytes that went to the server, and ``piece_at`` is when the
    last did that are more than a request's head.
    """

    def __init__(
        self,
        upstream: tuple[str, int] | Path,
        *others: tuple[str, int],
        failure: bytes = b"",
        rate: float | None = None,
    ):
        """With ``others`` each connection goes to the next in turn, or to whoever takes it."""
        self._upstreams = deque([upstream, *others])
        self._failure = failure
        self._rate = rate
        self._mode: Mode = "open"
        self.struck = 0
        self.passed = 0
        self.piece_at = 0.0
        self._writers: set[asyncio.StreamWriter] = set()
        self._changed = asyncio.Event()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        with socket.create_server(("127.0.0.1", 0)) as found:
            self.port: int = found.getsockname()[1]

    @property
    def address(self) -> str:
        return f"127.0.0.1:{self.port}"

    @property
    def mode(self) -> Mode:
        return self._mode

    def become(self, mode: Mode) -> None:
        self._do(self._become(mode))

    @contextmanager
    def being(self, mode: Mode) -> Iterator[None]:
        """Be so as long as the block."""
        self.become(mode)
        try:
            yield
        finally:
            self.become("open")

    def cut(self) -> None:
        """Reset all connections; the next ones pass."""
        self._loop.call_soon_threadsafe(self._cut_all)

    def __enter__(self):
        self._thread.start()
        self._do(self._listen())
        return self

    def __exit__(self, *_):
        self._do(self._close())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    def _do(self, work: Awaitable[None]) -> None:
        asyncio.run_coroutine_threadsafe(work, self._loop).result(30)

    async def _listen(self) -> None:
        self._server = await asyncio.start_server(self._serve, "127.0.0.1", self.port)

    async def _become(self, mode: Mode) -> None:
        before, self._mode = self._mode, mode
        if mode == "away":
            self._server.close()
        if mode in ("away", "failing") or before == "silent":
            # A firewall that swallowed packets has forgotten the connections.
            self.struck += len(self._writers) if mode != "open" else 0
            self._cut_all()
        if before == "away" and mode != "away":
            await self._listen()
        self._changed.set()
        self._changed = asyncio.Event()

    def _cut_all(self) -> None:
        for writer in list(self._writers):
            _reset(writer)

    async def _close(self) -> None:
        self._server.close()
        self._cut_all()
        tasks = [task for task in asyncio.all_tasks() if task is not asyncio.current_task()]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._writers.add(writer)
        ahead: asyncio.StreamWriter | None = None
        try:
            first = await reader.read(_MOST_READ)
            await self._gate()
            if self._mode == "failing":
                await self._fail(writer)
                return
            back, ahead = await self._connect()
            self._writers.add(ahead)
            self._count(first)
            ahead.write(first)
            ways = [
                asyncio.create_task(self._pass(reader, ahead, self._count)),
                asyncio.create_task(self._pass(back, writer, lambda _: None)),
            ]
            _, others = await asyncio.wait(ways, return_when=asyncio.FIRST_EXCEPTION)
            for other in others:
                other.cancel()
            await asyncio.gather(*ways, return_exceptions=True)
        except (OSError, asyncio.CancelledError):
            pass
        finally:
            for each in filter(None, (writer, ahead)):
                self._writers.discard(each)
                _reset(each)

    async def _connect(self) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        for _ in range(len(self._upstreams) - 1):
            with suppress(OSError):
                return await self._connect_next()
        return await self._connect_next()

    async def _connect_next(self) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        upstream = self._upstreams[0]
        self._upstreams.rotate(-1)
        if isinstance(upstream, Path):
            return await asyncio.open_unix_connection(str(upstream))
        return await asyncio.open_connection(*upstream)

    def _count(self, chunk: bytes) -> None:
        self.passed += len(chunk)
        if len(chunk) > _HEAD_BYTES:
            self.piece_at = time.monotonic()

    async def _pass(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, count: Callable[[bytes], None]
    ) -> None:
        most = _MOST_READ if self._rate is None else max(_HEAD_BYTES + 1, int(self._rate * _TICK_S))
        while chunk := await reader.read(most):
            await self._gate()
            if self._rate is not None:
                await asyncio.sleep(len(chunk) / self._rate)
            if writer.is_closing():  # it was cut meanwhile
                return
            count(chunk)
            writer.write(chunk)
            await writer.drain()
        if writer.can_write_eof():
            writer.write_eof()

    async def _gate(self) -> None:
        """Delay what is to pass for as long as the mode says."""
        while self._mode == "silent":
            self.struck += 1
            await self._changed.wait()
        if self._mode == "slow":
            self.struck += 1
            await asyncio.sleep(SLOW_S)

    async def _fail(self, writer: asyncio.StreamWriter) -> None:
        self.struck += 1
        if self._failure:
            writer.write(self._failure)
            await writer.drain()
            writer.close()
            with suppress(OSError):
                await writer.wait_closed()


def _reset(writer: asyncio.StreamWriter) -> None:
    found = writer.get_extra_info("socket")
    if found is not None and not writer.is_closing():
        with suppress(OSError):
            if found.family != socket.AF_UNIX:
                found.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESET)
    writer.transport.abort()
