"""A small disk, which tests may fill."""

import ctypes
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

# Linux, sched.h
_CLONE_FS = 0x00000200
_CLONE_NEWNS = 0x00020000


@contextmanager
def small_disk(folder: Path, *, megabytes: int = 96) -> Iterator[Path]:
    """Mount a disk that only this thread sees, and the threads and processes that it starts meanwhile."""
    if sys.platform != "linux":
        pytest.skip("a small disk of its own needs Linux")
    before, where = os.open("/proc/thread-self/ns/mnt", os.O_RDONLY), Path.cwd()
    root = os.open("/", os.O_RDONLY)
    try:
        _call("unshare", _CLONE_NEWNS)
        # Threads that were started since share its folders, and a thread that shares them may not go back.
        try:
            _mount("--make-rprivate", "/")
            _mount("-t", "tmpfs", "-o", f"size={megabytes}m", "tmpfs", str(folder))
            yield folder
        finally:
            _call("unshare", _CLONE_FS)
            _call("setns", before, _CLONE_NEWNS)
            # which leads out of a chroot
            os.fchdir(root)
            os.chroot(".")
            os.chdir(where)
    except PermissionError as error:
        pytest.skip(f"a small disk of its own needs root: {error}")
    finally:
        os.close(before)
        os.close(root)


@contextmanager
def filled(disk: Path, *, but_bytes: int = 0) -> Iterator[None]:
    """Leave no more than these bytes free for as long as the block lasts."""
    filler = disk / "filler"
    with filler.open("wb", buffering=0) as file:
        while (size := min(1 << 20, shutil.disk_usage(disk).free - but_bytes)) > 0:
            with suppress(OSError):
                file.write(bytes(size))
    try:
        yield
        assert shutil.disk_usage(disk).free < but_bytes + (1 << 20), "the disk did not stay full"
    finally:
        filler.unlink()


def _mount(*words: str) -> None:
    done = subprocess.run(["mount", *words], check=False, capture_output=True, text=True, timeout=30)
    if done.returncode:
        raise PermissionError(done.stderr.strip())


def _call(name: str, *arguments: int) -> None:
    libc = ctypes.CDLL(None, use_errno=True)
    if getattr(libc, name)(*arguments):
        raise OSError(ctypes.get_errno(), f"{name}: {os.strerror(ctypes.get_errno())}")
