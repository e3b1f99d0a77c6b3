"""The child is found when it is ready, and is gone when the demo is, in whatever way that ends."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from demo.child import NotServing, serving

ROOT = Path(__file__).resolve().parents[2]
STAND_IN = """
import os, pathlib, sys, time
data = pathlib.Path(os.environ["STILB_DATA"])
(data / "pid").write_text(str(os.getpid()))
print("a line of no concern", flush=True)
print(f"ready http://127.0.0.1:{os.environ['STILB_PORT']} key secret", flush=True)
time.sleep(60)
"""
COMMAND = (sys.executable, "-c", STAND_IN)


def is_alive(pid):
    try:
        status = Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    except FileNotFoundError:
        return False
    return "State:\tZ" not in status  # a zombie is dead, only not buried


def test_the_ready_line_says_where_and_with_which_key(tmp_path, monkeypatch):
    monkeypatch.setenv("STILB_PORT", "8123")
    with serving(tmp_path, command=COMMAND) as service:
        assert (service.url, service.key) == ("http://127.0.0.1:8123", "secret")


def test_any_free_port_does_where_none_is_set(tmp_path, monkeypatch):
    monkeypatch.delenv("STILB_PORT", raising=False)
    with serving(tmp_path, command=COMMAND) as service:
        assert service.url == "http://127.0.0.1:0"  # the real one puts the port it found in its place


def test_it_is_stopped_at_the_end_also_after_an_error(tmp_path):
    with pytest.raises(ValueError, match="in the middle"), serving(tmp_path, command=COMMAND):
        raise ValueError("in the middle")
    assert not is_alive(int((tmp_path / "pid").read_text()))


def test_a_service_that_cannot_start_is_an_error(tmp_path):
    command = (sys.executable, "-c", "raise SystemExit(3)")
    with pytest.raises(NotServing, match="exit code 3"), serving(tmp_path, command=command):
        pass


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells a child of its parent's death")
def test_it_does_not_outlive_a_demo_that_is_killed(tmp_path):
    program = (
        "import pathlib, sys, time; from demo.child import serving\n"
        "with serving(pathlib.Path(sys.argv[1]), command=(sys.executable, '-c', sys.argv[2])):\n"
        "    print('up', flush=True); time.sleep(60)\n"
    )
    demo = subprocess.Popen(
        [sys.executable, "-c", program, str(tmp_path), STAND_IN],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        text=True,
    )
    with demo:
        assert demo.stdout.readline() == "up\n"
        pid = int((tmp_path / "pid").read_text())
        assert is_alive(pid)
        demo.send_signal(signal.SIGKILL)
    end = time.monotonic() + 5
    while is_alive(pid) and time.monotonic() < end:
        time.sleep(0.02)
    assert not is_alive(pid)
