"""A pulse beats without clock, database or room; what hangs behind it is killed, what was paused is not."""

import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import pytest

from store.pulse import Pulse, end_hung, read_beat

BEATING = """
import sys, time
from store.pulse import Pulse
pulse = Pulse(sys.argv[1])
print("up", flush=True)
while True:
    pulse.beat()
    time.sleep(0.05)
"""


@contextmanager
def beating(path):
    with subprocess.Popen([sys.executable, "-c", BEATING, path], stdout=subprocess.PIPE) as process:
        assert process.stdout.readline() == b"up\n"
        try:
            yield process
        finally:
            process.kill()


def test_each_beat_is_told_from_the_one_before(tmp_path):
    pulse = Pulse(str(tmp_path / "pulse"))
    first = read_beat(tmp_path / "pulse")
    pulse.beat()
    assert first < read_beat(tmp_path / "pulse") <= time.monotonic_ns()


@pytest.mark.parametrize("path", ["", "/proc/nowhere/pulse"])
def test_a_beat_that_cannot_be_written_ends_nobody(path):
    Pulse(path).beat()


def test_what_hangs_is_killed_and_what_was_paused_is_not(tmp_path):
    with beating(tmp_path / "pulse") as process:
        os.kill(process.pid, signal.SIGSTOP)
        time.sleep(0.5)
        os.kill(process.pid, signal.SIGCONT)
        assert not end_hung(tmp_path / "pulse", hang_s=0.3, look_again_s=2.0)
        os.kill(process.pid, signal.SIGSTOP)
        time.sleep(0.5)
        assert end_hung(tmp_path / "pulse", hang_s=0.3, look_again_s=0.2)
        assert process.wait() == -signal.SIGKILL


def test_the_health_check_of_a_container(tmp_path):
    (tmp_path / "limit").write_text("2.5\n")
    environment = {"STILB_PULSE": str(tmp_path / "pulse")}
    environment["STILB_DATABASE_TIMEOUT_S_FILE"] = str(tmp_path / "limit")

    def check(*arguments):
        command = [sys.executable, "-m", "store.pulse", *arguments]
        return subprocess.run(command, env=environment, check=False).returncode

    assert check() == 0, "a part that has not come so far yet"
    with beating(tmp_path / "pulse"):
        assert check() == 0
        assert check("http://127.0.0.1:9/readyz") == 1
