"""What a drill does to the machine itself: a disk that fills up, a clock that somebody sets."""

import os
import shutil
import struct
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

_DISK_MB = 96
_ALONE = "DRILL_HAS_ITS_OWN_MOUNTS"


class CannotStrike(Exception):  # noqa: N818 (it says what was found)
    """This machine does not allow the fault; the message says why."""


@contextmanager
def small_disk(folder: Path) -> Iterator[Path]:
    """A folder that is a small disk of its own, which nobody but this process and its children sees."""
    if _ALONE not in os.environ:
        raise CannotStrike("a small disk of its own needs root")
    mount = ["mount", "-t", "tmpfs", "-o", f"size={_DISK_MB}m", "tmpfs", folder]
    subprocess.run(mount, check=True, timeout=30)
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", folder], check=True, timeout=30)


def be_alone_with_mounts() -> None:
    """Begin this program anew where what it mounts is its own and goes with it, if this may be done here."""
    if _ALONE not in os.environ and _can_mount():
        again = ["unshare", "--mount", sys.executable, "-m", "tests.faults", *sys.argv[1:]]
        os.execvpe(again[0], again, os.environ | {_ALONE: "1"})


@contextmanager
def filled(disk: Path) -> Iterator[None]:
    """No byte is free on the disk, as long as the block."""
    filler = disk / "filler"
    with filler.open("wb", buffering=0) as file:
        for size in (1 << 20, 4096):
            try:
                while True:
                    file.write(bytes(size))
            except OSError:
                pass
    try:
        assert shutil.disk_usage(disk).free < 4096, "the disk is not full"
        yield
        assert shutil.disk_usage(disk).free < 1 << 20, "the disk did not stay full"
    finally:
        filler.unlink()


class Clock:
    """The clock on the wall of all processes that are started with ``environment``; `shift_s` sets it."""

    def __init__(self, folder: Path):
        self._file = folder / "clock"
        self.set(0)
        self.environment = {"LD_PRELOAD": str(_compiled(folder)), "DRILL_CLOCK": str(self._file)}
        shown = self._shown()
        self.set(-3600)
        if not 3590 < shown - self._shown() < 3610:
            raise CannotStrike("the clock of a process could not be shifted")
        self.set(0)

    def set(self, shift_s: int) -> None:
        self.shift_s = shift_s
        # Written in place: the processes have it mapped.
        with self._file.open("r+b" if self._file.exists() else "wb") as file:
            file.write(struct.pack("=q", shift_s))

    def _shown(self) -> float:
        command = [sys.executable, "-c", "import time; print(time.time())"]
        return float(
            subprocess.run(
                command, env=os.environ | self.environment, capture_output=True, check=True, timeout=30
            ).stdout
        )


def _compiled(folder: Path) -> Path:
    compiler = shutil.which("cc")
    if sys.platform != "linux" or compiler is None:
        raise CannotStrike("shifting the clock of a process needs Linux and a C compiler")
    library = folder / "clock.so"
    source = Path(__file__).with_name("clock.c")
    subprocess.run([compiler, "-shared", "-fPIC", "-O1", "-o", library, source], check=True, timeout=60)
    return library


def _can_mount() -> bool:
    if sys.platform != "linux" or shutil.which("unshare") is None:
        return False
    mount = ["unshare", "--mount", "mount", "-t", "tmpfs", "tmpfs", "/mnt"]
    return subprocess.run(mount, check=False, capture_output=True, timeout=30).returncode == 0


def described() -> str:
    """The machine in a few words."""
    with ExitStack() as stack:
        lines = stack.enter_context(Path("/proc/cpuinfo").open()).read().splitlines()
    model = next((line.partition(": ")[2] for line in lines if line.startswith("model name")), "unknown")
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / (1 << 30)
    return f"{os.cpu_count()} cores ({model}), {memory:.0f} GiB, Linux {os.uname().release}"
