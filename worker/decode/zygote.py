"""The zygote: a process that has read nothing but a file of our own, forked once for every file.

It has one thread, because a fork takes along only the thread that forks: LibRaw and OpenMP lock up in a child
whose parent had decoded. Its own standard input is a socket on which the orders for cells come.
"""

import argparse
import contextlib
import gc
import importlib
import json
import os
import select
import signal
import socket
import traceback
from pathlib import Path
from typing import Any, Final, NoReturn

import imagecodecs

from store.sandbox import Restrictions, Sandbox
from worker.decode import cell
from worker.decode.budget import read_address_space
from worker.decode.libraw import check_version
from worker.decode.messages import BrokenMessageError
from worker.decode.settings import DecoderLimits
from worker.decode.warmup import make_smallest_dng, make_smallest_stream, warm_up

_LOOK_FOR_PARENT_MS: Final = 500
_ORDER_DESCRIPTORS: Final = 2
_MOST_DESCRIPTORS: Final = 4096
_TIMES: Final = 20
# What libraries import when it is first used, which a cell no longer can.
_LATE_IMPORTS: Final = ("_strptime", "multiprocessing.context", "numpy.ma", "xml.parsers.expat")
_CODECS: Final = (
    "jpeg8_decode",
    "lzw_decode",
    "packbits_decode",
    "png_decode",
    "png_encode",
)


def main() -> None:
    arguments = _parse_arguments()
    control = socket.socket(fileno=os.dup(0))
    rawpy = check_version()
    load_late_imports()
    restrictions = Restrictions()
    sandbox = _try_sandbox(restrictions)
    prepared = cell.Prepared(
        restrictions=restrictions,
        bounds=DecoderLimits(memory_bytes=arguments.memory_bytes, cpu_seconds=arguments.cpu_seconds),
        address_space=read_address_space(),
        first_file=make_smallest_dng(),
        first_stream=make_smallest_stream(),
    )
    # what the interpreter and the loader note down when code is first run is then shared by all cells
    for _ in range(_TIMES):
        warm_up(prepared.first_file, prepared.first_stream)
    ready = {"ready": True, "rawpy": rawpy, "sandbox": vars(sandbox), "threads": _count_threads()}
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


def _count_threads() -> int:
    return sum(1 for _ in Path("/proc/self/task").iterdir())


def _parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="worker.decode", description="Decode raw files for a parent process."
    )
    parser.add_argument("--parent", type=int, required=True, help="the process to die with")
    parser.add_argument("--memory-bytes", type=int, required=True)
    parser.add_argument("--cpu-seconds", type=int, required=True)
    return parser.parse_args()


def _try_sandbox(restrictions: Restrictions) -> Sandbox:
    """Shut a first cell in, which does nothing else: what held there is expected of every other."""
    ours, its = os.pipe()
    pid = os.fork()
    if not pid:
        with contextlib.suppress(BaseException):
            os.write(its, json.dumps(vars(restrictions.shut_in())).encode())
        os._exit(0)
    os.close(its)
    told = os.read(ours, 4096)
    os.close(ours)
    os.waitpid(pid, 0)
    return Sandbox(**json.loads(told))


class _Zygote:
    def __init__(
        self,
        control: socket.socket,
        parent: int,
        prepared: cell.Prepared,
        sandbox: Sandbox,
    ) -> None:
        self._control = control
        self._parent = parent
        self._prepared = prepared
        self._sandbox = sandbox
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
        pid = os.fork()
        if not pid:
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
                os.dup2(talk, cell.TALK)
                os.closerange(3, _MOST_DESCRIPTORS)
                code = cell.live(self._prepared, self._sandbox)
        except (BrokenMessageError, BrokenPipeError, ConnectionResetError):
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
