"""A small disk, which tests may fill."""

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from tests.support.deployments import spawn


@contextmanager
def small_disk(folder: Path, *, megabytes: int = 64) -> Iterator[Path]:
    """Yield a folder on a disk of its own, which only its holder has mounted: it goes when that dies."""
    script = f"mount -t tmpfs -o size={megabytes}m tmpfs {folder} && echo mounted && exec sleep 3600"
    command = ["unshare", "--mount", "sh", "-c", script]
    try:
        holder = spawn(command, dict(os.environ), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    except OSError as error:
        pytest.skip(f"no small disk can be mounted here: {error}")
    with holder:
        if holder.stdout.readline() != "mounted\n":
            pytest.skip(f"no small disk can be mounted here: {holder.stderr.read()}")
        try:
            yield Path(f"/proc/{holder.pid}/root", *folder.absolute().parts[1:])
        finally:
            holder.kill()


@contextmanager
def filled(disk: Path) -> Iterator[None]:
    """Leave no byte free for as long as the block lasts."""
    filler = disk / "filler"
    with filler.open("wb", buffering=0) as file:
        for size in (1 << 20, 4096, 1):
            with suppress(OSError):
                while file.write(bytes(size)):
                    pass
    try:
        yield
    finally:
        filler.unlink()
