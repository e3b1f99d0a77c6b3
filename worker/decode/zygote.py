"""The zygote: a process that has read nothing but a file of our own, forked once for every file.

It has one thread, because a fork takes along only the thread that forks: LibRaw and OpenMP lock up in a child
whose parent had decoded. Its own standard input is a socket on which the orders for cells come.
"""

import argparse
import contextlib
import errno
import fcntl
import gc
import importlib
import json
import mmap
import os
import select
import signal
import socket
import struct
import sys
import traceback
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, NoReturn

import imagecodecs
import numpy as np

from radiometry.findings import InputRejected
from store.sandbox import OPEN_FILES, Restrictions, Sandbox
from worker.decode import libraw, limits, ljpeg, messages, pieces, tiff
from worker.decode.reader import Reader, Window

_SIDE_PX: Final = 16
# A region of 5 % of 50 million pixels, and a MiB for its decoder. What is larger comes from the kernel, and
# goes back to it at once. From 4 MiB on numpy asks for huge pages, of which 6 MiB cost what 2 MiB of small
# ones do.
_OWNED_BYTES: Final = 6 << 20
_PAGE_BYTES: Final = 4096
_SHORT, _LONG, _BYTE = 3, 4, 1
_HEAD: Final = 8
_TAGS: Final = (
    (256, _LONG, 1, struct.pack("<I", _SIDE_PX)),
    (257, _LONG, 1, struct.pack("<I", _SIDE_PX)),
    (258, _SHORT, 1, struct.pack("<I", 16)),
    (259, _SHORT, 1, struct.pack("<I", 1)),
    (262, _SHORT, 1, struct.pack("<I", 32803)),
    (273, _LONG, 1, struct.pack("<I", _HEAD)),
    (279, _LONG, 1, struct.pack("<I", 2 * _SIDE_PX**2)),
    (33421, _SHORT, 2, struct.pack("<HH", 2, 2)),
    (33422, _BYTE, 4, bytes((0, 1, 1, 2))),
    (50706, _BYTE, 4, bytes((1, 4, 0, 0))),
)


def make_smallest_dng() -> bytes:
    """Return a mosaic of zeros with the least that a DNG must say."""
    samples = bytes(2 * _SIDE_PX**2)
    entries = b"".join(struct.pack("<HHI4s", *tag) for tag in _TAGS)
    directory = struct.pack("<H", len(_TAGS)) + entries + bytes(4)
    return struct.pack("<2sHI", b"II", 42, _HEAD + len(samples)) + samples + directory


def make_smallest_stream() -> bytes:
    return bytes(imagecodecs.ljpeg_encode(np.zeros((_SIDE_PX, _SIDE_PX), np.uint16), bitspersample=16))


def own_memory() -> None:
    """Write to as much memory as a region needs, and let the C library keep it for that."""
    pieces.keep_memory(2 * _OWNED_BYTES)
    np.empty(_OWNED_BYTES, np.uint8)[::_PAGE_BYTES] = 0


def warm_up(content: bytes, stream: bytes) -> None:
    """Read a file and a compressed piece as a cell does, for the sake of what that touches."""
    reader = Reader(tiff.Source(content), limits.allow_all)
    messages.decode(messages.encode(asdict(reader.read_header())))
    reader.read_window(Window(0, 0, _SIDE_PX, _SIDE_PX))
    ljpeg.decode(stream, samples=_SIDE_PX**2)


TALK: Final = 0


@dataclass(frozen=True, kw_only=True)
class Prepared:
    """Resources of all cells; ``address_space`` is that of a process without a file [bytes]."""

    restrictions: Restrictions
    bounds: limits.DecoderLimits
    address_space: int
    first_file: bytes
    first_stream: bytes


def live(prepared: Prepared, expected: Sandbox) -> int:
    """Lose the world, wait for the file, and answer until nobody asks any more; the exit code.

    Nobody asks any more when the socket is closed: that raises BrokenMessageError or BrokenPipeError.
    Descriptor 0 brings the file and the requests and takes the answers, 1 and 2 lead nowhere; there are no
    others.
    """
    talk = socket.socket(fileno=os.dup(TALK))
    if prepared.restrictions.shut_in(pieces.start_second_thread) != expected:
        return limits.NOT_SHUT_IN
    own_memory()
    warm_up(prepared.first_file, prepared.first_stream)
    if (descriptor := _receive_file(talk)) is None:
        return 0
    content = _map(descriptor)
    budget = limits.Budget(prepared.bounds, before=prepared.address_space, file_bytes=len(content))
    request, _ = messages.receive(TALK)
    digests = None if request["digests"] is None else bytes.fromhex(request["digests"])
    try:
        reader = Reader(tiff.Source(content, digests), budget.allow)
    except tiff.SourceDamagedError:
        messages.send(TALK, {"damaged": True})
        return 0
    while True:
        messages.send(TALK, *_answer(reader, request))
        request, _ = messages.receive(TALK)
        budget.begin_request()


def _receive_file(talk: socket.socket) -> int | None:
    """The file's descriptor, which comes with the first byte; None when there will be no file."""
    with talk:
        content, descriptors, _, _ = socket.recv_fds(talk, 1, 1)
    return descriptors[0] if content and len(descriptors) == 1 else None


def _map(descriptor: int) -> mmap.mmap | bytes:
    """Map the file and let go of its descriptor: what is left is memory that nobody can write to."""
    if fcntl.fcntl(descriptor, fcntl.F_GETFL) & os.O_ACCMODE != os.O_RDONLY:
        raise ValueError("a cell is given a file that is open for reading only")
    # not asked of fstat: on some systems that is a call which also takes paths, and is lost
    size = os.lseek(descriptor, 0, os.SEEK_END)
    # a mapping of nothing is refused by the system
    content = mmap.mmap(descriptor, size, access=mmap.ACCESS_READ) if size else b""
    # the descriptor, and the copy that Python keeps with the mapping
    os.closerange(3, OPEN_FILES)
    return content


def _read(reader: Reader, request: dict[str, Any]) -> tuple[dict[str, Any], bytes | memoryview]:
    match request["do"]:
        case "read_header":
            return {"header": asdict(reader.read_header())}, b""
        case "read_window":
            frame = reader.read_window(Window(*request["window"]))
            told = {name: value for name, value in vars(frame).items() if name != "samples_dn"}
            return {"frame": told}, frame.samples_dn.data
        case _:
            preview, proof = reader.inspect(request["longest_side_px"])
            return {"proof": asdict(proof)}, preview


def _answer(reader: Reader, request: dict[str, Any]) -> tuple[dict[str, Any], bytes | memoryview]:
    try:
        return _read(reader, request)
    except InputRejected as refusal:
        return {"refused": {"code": str(refusal.code), "message": refusal.message}}, b""
    except tiff.SourceDamagedError:
        return {"damaged": True}, b""
    except Exception as error:  # noqa: BLE001  the last line before a hostile file becomes our failure
        if isinstance(error, MemoryError) or getattr(error, "errno", None) == errno.ENOMEM:
            return {"failed": "it needs more memory than is allowed"}, b""
        print(f"{request.get('do')}: {error!r}", file=sys.stderr)  # noqa: T201
        return {"failed": type(error).__name__}, b""


_LOOK_FOR_PARENT_MS: Final = 500
_ORDER_DESCRIPTORS: Final = 2
_MOST_DESCRIPTORS: Final = 4096
_TIMES: Final = 20
# What libraries import when it is first used, which a cell no longer can.
_LATE_IMPORTS: Final = ("_strptime", "multiprocessing.context", "numpy.ma", "xml.parsers.expat")
_CODECS: Final = ("jpeg8_decode", "lzw_decode", "packbits_decode", "png_decode", "png_encode")


def main() -> None:
    arguments = _parse_arguments()
    control = socket.socket(fileno=os.dup(0))
    rawpy = libraw.check_version()
    load_late_imports()
    restrictions = Restrictions()
    sandbox = _try_sandbox(restrictions)
    prepared = Prepared(
        restrictions=restrictions,
        bounds=limits.DecoderLimits(memory_bytes=arguments.memory_bytes, cpu_seconds=arguments.cpu_seconds),
        address_space=limits.read_address_space(),
        first_file=make_smallest_dng(),
        first_stream=make_smallest_stream(),
    )
    # what the interpreter and the loader note down when code is first run is then shared by all cells
    for _ in range(_TIMES):
        warm_up(prepared.first_file, prepared.first_stream)
    threads = len(list(Path("/proc/self/task").iterdir()))
    ready = {"ready": True, "rawpy": rawpy, "sandbox": vars(sandbox), "threads": threads}
    zygote = _Zygote(control, arguments.parent, prepared, sandbox)
    # Objects that nobody looks at again are not copied by the cells' collections.
    gc.collect()
    gc.freeze()
    control.send(json.dumps(ready).encode())
    zygote.serve()


def load_late_imports() -> None:
    for name in _LATE_IMPORTS:
        importlib.import_module(name)
    for name in _CODECS:
        getattr(imagecodecs, name)


def _parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="worker.decode", description="Decode files for a parent process.")
    parser.add_argument("--parent", type=int, required=True, help="the process to die with")
    parser.add_argument("--memory-bytes", type=int, required=True)
    parser.add_argument("--cpu-seconds", type=int, required=True)
    return parser.parse_args()


def _try_sandbox(restrictions: Restrictions) -> Sandbox:
    """Shut a first cell in, which does nothing else: what held there is expected of every other."""
    ours, its = os.pipe()
    if not (pid := os.fork()):
        with contextlib.suppress(BaseException):
            os.write(its, json.dumps(vars(restrictions.shut_in())).encode())
        os._exit(0)
    os.close(its)
    told = os.read(ours, 4096)
    os.close(ours)
    os.waitpid(pid, 0)
    return Sandbox(**json.loads(told))


class _Zygote:
    def __init__(self, control: socket.socket, parent: int, prepared: Prepared, sandbox: Sandbox) -> None:
        self._control, self._parent, self._prepared, self._sandbox = control, parent, prepared, sandbox
        self._own_pid = os.getpid()
        self._pids: dict[int, int] = {}  # by the descriptor of each cell's line
        self._lines: dict[int, socket.socket] = {}  # to the one who ordered it, by the cell's pid
        self._poll = select.poll()

    def serve(self) -> None:
        """Fork cells as they are ordered, until the parent is gone; the kernel ends them with this."""
        woken, wake = os.pipe()
        os.set_blocking(wake, False)
        signal.signal(signal.SIGCHLD, lambda *_: None)
        signal.set_wakeup_fd(wake, warn_on_full_buffer=False)
        for descriptor in (self._control.fileno(), woken):
            self._poll.register(descriptor, select.POLLIN)
        # The closed socket is not enough: a fork of the parent may hold its other end open.
        while os.getppid() == self._parent:
            for descriptor, _ in self._poll.poll(_LOOK_FOR_PARENT_MS):
                if descriptor == woken:
                    os.read(woken, 4096)
                elif descriptor != self._control.fileno():
                    self._end(descriptor)
                elif not self._take_order():
                    return
            self._bury()

    def _take_order(self) -> bool:
        """Fork a cell with the descriptor that it talks on; its fate is told on another."""
        order, descriptors, _, _ = socket.recv_fds(self._control, 64, _ORDER_DESCRIPTORS)
        if not order:
            return False
        talk, line = descriptors
        if not (pid := os.fork()):
            self._become_cell(talk)
        os.close(talk)
        self._pids[line] = pid
        self._lines[pid] = socket.socket(fileno=line)
        self._poll.register(line, select.POLLIN)
        self._tell(pid, {"pid": pid})
        return True

    def _become_cell(self, talk: int) -> NoReturn:
        """Whatever happens, nothing of the zygote's own goes on in this process."""
        code = 1
        try:
            signal.set_wakeup_fd(-1)
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            self._prepared.restrictions.die_with_parent()
            if os.getppid() == self._own_pid:
                os.dup2(talk, TALK)
                os.closerange(3, _MOST_DESCRIPTORS)
                code = live(self._prepared, self._sandbox)
        except (messages.BrokenMessageError, BrokenPipeError, ConnectionResetError):
            code = 0
        except BaseException:  # noqa: BLE001
            traceback.print_exc()
        finally:
            os._exit(code)

    def _end(self, line: int) -> None:
        """End a cell whose owner has hung up; its pid is safe to use until it is buried."""
        self._poll.unregister(line)
        os.kill(self._pids[line], signal.SIGKILL)

    def _bury(self) -> None:
        while self._lines:
            pid, status = os.waitpid(-1, os.WNOHANG)
            if not pid:
                return
            self._tell(pid, {"ended": os.waitstatus_to_exitcode(status)})
            line = self._lines.pop(pid)
            with contextlib.suppress(KeyError):
                self._poll.unregister(line.fileno())
            del self._pids[line.fileno()]
            line.close()

    def _tell(self, pid: int, what: dict[str, Any]) -> None:
        with contextlib.suppress(OSError):
            self._lines[pid].send(json.dumps(what).encode())
