"""A zygote whose cells have been taken over: a file that begins with PROBE or SPIN is obeyed.

`python -m tests.worker.decode.probing` stands in for `python -m worker.decode`; nothing else differs.
"""

import contextlib
import ctypes
import fcntl
import json
import mmap
import os
import socket
import subprocess
import threading
import time
from pathlib import Path

import numpy as np

from worker.decode import pieces, zygote

LIBC = ctypes.CDLL(None, use_errno=True)
REFUSED = (OSError, RuntimeError, ValueError, AttributeError, subprocess.SubprocessError)
CALLS = {
    "ptrace": (101, 0x4206),
    "process_vm_readv": (310, -1),
    "pidfd_open": (434, -1),
    "keyctl": (250, 0),
    "bpf": (321, 0),
    "io_uring_setup": (425, 8),
    "unshare": (272, 0x10000000),
    "memfd_create": (319, -1),
    "userfaultfd": (323, 0),
    "perf_event_open": (298, 0),
}


def _read(path):
    with Path(path).open("rb") as file:
        return file.read(1)


def _write(path):
    with Path(path).open("r+b") as file, mmap.mmap(file.fileno(), 0) as mapped:
        mapped[0] = mapped[0]
    return True


def _connect(family, address):
    with socket.socket(family) as line:
        line.connect(address)
    return True


def _thread():
    thread = threading.Thread(target=int)
    thread.start()
    thread.join()
    return True


def _own_descriptors():
    """Those beyond requests, answers and the way to nowhere."""
    for descriptor in range(3, 64):
        with contextlib.suppress(OSError):
            fcntl.fcntl(descriptor, fcntl.F_GETFD)
            return True
    return False


def _executable_memory():
    LIBC.mmap.restype = ctypes.c_void_p
    return LIBC.mmap(None, ctypes.c_size_t(4096), 7, 0x22, -1, ctypes.c_long(0)) != ctypes.c_void_p(-1).value


def _find_stale(samples):
    """In memory of every size that is handed out without being cleared."""
    held = [np.empty(size, np.uint8) for size in (1 << 10, 1 << 14, 1 << 17, 1 << 20, 3 << 20)]
    return any(samples in each.tobytes() for each in held)


def _own_by(descriptor, pid):
    """Have the kernel signal another process when something comes."""
    fcntl.fcntl(descriptor, fcntl.F_SETOWN, pid)
    return True


# 0x4206: PTRACE_SEIZE, which does not stop its victim
def _call(name, pid):
    number, argument = CALLS[name]
    if name == "process_vm_readv":
        return LIBC.syscall(number, pid, None, 0, None, 0, 0) >= 0
    if name == "memfd_create":
        return LIBC.syscall(number, b"x", 0) >= 0
    if name == "ptrace":
        return LIBC.syscall(number, argument, pid, 0, 0) >= 0
    if name == "pidfd_open":
        return LIBC.syscall(number, pid, 0, 0, 0) >= 0
    return LIBC.syscall(number, argument, ctypes.create_string_buffer(256), 0, 0, 0) >= 0


def list_probes(world):
    """What a hostile file would do, by name; each returns something or fails."""
    worker = world["worker"]
    return {
        "reads the key": lambda: _read(world["key"]),
        "reads the database": lambda: _read(world["database"]),
        "reads /etc": lambda: _read("/etc/passwd"),
        "looks at the database": Path(world["database"]).stat,
        "lists /": lambda: list(Path("/").iterdir()),
        "reads the worker's environment": lambda: _read(f"/proc/{worker}/environ"),
        "reads the worker's memory": lambda: _read(f"/proc/{worker}/mem"),
        "has a secret": lambda: "a secret" in str(os.environ),
        "connects by TCP": lambda: _connect(socket.AF_INET, ("127.0.0.1", world["tcp"])),
        "connects by a path": lambda: _connect(socket.AF_UNIX, world["unix"]),
        "sends UDP": lambda: socket.socket(socket.AF_INET, socket.SOCK_DGRAM),
        "runs a shell": lambda: subprocess.run(["/bin/sh", "-c", "true"], check=True),
        "forks": lambda: os.waitpid(os.fork() or os._exit(0), 0),
        "starts a thread": _thread,
        "writes the stored file": lambda: _write(world["stored"]),
        "writes through its descriptors": lambda: [_write(f"/proc/self/fd/{number}") for number in (0, 3, 4)],
        "makes a file": lambda: Path(world["stored"] + ".new").touch() or True,
        "signals the worker": lambda: os.kill(worker, 0) is None,
        "has itself signalled": lambda: _own_by(0, worker),
        "holds more descriptors": _own_descriptors,
        "makes memory executable": _executable_memory,
        "finds another file's samples": lambda: _find_stale(bytes.fromhex(world["samples"])),
        "moves the worker": lambda: os.sched_setaffinity(worker, os.sched_getaffinity(worker)) is None,
        **{name: lambda name=name: _call(name, worker) for name in CALLS},
    }


def probe(world):
    """The names of all that succeeded."""
    found = []
    for name, act in list_probes(world).items():
        with contextlib.suppress(*REFUSED):
            if act():
                found.append(name)
    return found


def _make_writable(source):
    """Turn the mapping of the file into one that can be written to."""
    address = np.frombuffer(source._content, np.uint8).ctypes.data
    return LIBC.mprotect(ctypes.c_void_p(address), ctypes.c_size_t(4096), 3) == 0


def _obey(reader, request, answer=zygote._answer):
    content = reader._source[:]
    if content.startswith(b"SPIN"):
        while True:
            time.monotonic()
    if content.startswith(b"WAIT"):
        os.read(zygote.TALK, 1)
    if content.startswith(b"PROBE"):
        world = json.loads(content[5:])
        found = [] if pieces._second else ["has one thread only"]
        for thread in pieces._second:
            found += thread._executor.submit(probe, world).result()
        found += probe(world)
        if _make_writable(reader._source):
            found.append("writes to what was mapped")
        return {"refused": {"code": "not_a_raw_file", "message": json.dumps(found)}}, b""
    return answer(reader, request)


if __name__ == "__main__":
    zygote._answer = _obey
    zygote.main()
