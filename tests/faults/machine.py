"""What a drill does to the machine itself: a clock that somebody sets."""

import os
import shutil
import struct
import subprocess
import sys
from pathlib import Path

import pytest


class Clock:
    """The clock on the wall of all processes that are started with ``environment``; `shift_s` sets it."""

    def __init__(self, folder: Path):
        self._file = folder / "clock"
        self.set(0)
        self.environment = {"LD_PRELOAD": str(_compiled(folder)), "DRILL_CLOCK": str(self._file)}
        shown = self._shown()
        self.set(-3600)
        if not 3590 < shown - self._shown() < 3610:
            pytest.skip("the clock of a process could not be shifted")
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
        pytest.skip("shifting the clock of a process needs Linux and a C compiler")
    library = folder / "clock.so"
    source = Path(__file__).with_name("clock.c")
    subprocess.run([compiler, "-shared", "-fPIC", "-O1", "-o", library, source], check=True, timeout=60)
    return library


def described() -> str:
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    model = next((line.partition(": ")[2] for line in lines if line.startswith("model name")), "unknown")
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / (1 << 30)
    return f"{os.cpu_count()} cores ({model}), {memory:.0f} GiB, Linux {os.uname().release}"
