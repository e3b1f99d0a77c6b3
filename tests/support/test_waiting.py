"""A wait that is in vain says for what, and how things stood; a test that hangs is ended."""

import re
import subprocess
import sys

import pytest

from tests.support.waiting import wait_for

HANGS = """
import threading
import pytest

@pytest.mark.timeout(1)
def test_hangs():
    threading.Event().wait()

def test_goes_on():
    pass
"""


def test_it_names_itself_and_shows_what_it_looked_at():
    pids = [17, 23]
    with pytest.raises(AssertionError, match=r"0.02 s in vain for .*not pids.*False, pids = \[17, 23\]"):
        wait_for(lambda: not pids, timeout_s=0.02)


def test_it_says_what_it_was_told_to_say():
    with pytest.raises(AssertionError, match="for the sweeper's end: last answer None, it runs"):
        wait_for(lambda: None, "the sweeper's end", timeout_s=0.02, seen=lambda: "it runs")


def test_a_test_that_hangs_is_ended_with_its_stacks_and_the_next_one_runs(tmp_path):
    (tmp_path / "test_hanging.py").write_text(HANGS)
    plain = ["-c", "/dev/null", "-p", "no:schemathesis", "-p", "no:valkey", "-p", "no:cacheprovider"]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-n", "1", *plain, tmp_path],
        check=False,
        capture_output=True,
        text=True,
        cwd=tmp_path,
    )
    assert "1 failed, 1 passed" in done.stdout
    assert "threading.Event().wait()" in done.stdout
    assert re.search(r"Timeout.*1\.0s", done.stdout)


def test_every_test_has_a_limit(pytestconfig):
    assert 0 < float(pytestconfig.getini("timeout")) <= 1800
