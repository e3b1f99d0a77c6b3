"""The first minutes as the README prints them: the demo with its figures, then K from Python."""

import doctest
import os
import re
import signal
import subprocess

import pytest

from tests.support.printed import link_checkout, read_blocks

SERVING = re.compile(r"serving (\S+) key (\S+) until Ctrl-C")


@pytest.mark.timeout(600)
def test_the_demo_prints_these_figures_and_then_serves_them(tmp_path):
    link_checkout(tmp_path)
    command, *expected = read_blocks("README.md", "console")[0].removeprefix("$ ").splitlines()
    with subprocess.Popen(
        ["bash", "-c", command],
        cwd=tmp_path,
        env={name: value for name, value in os.environ.items() if not name.startswith("STILB_")},
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as demo:
        try:
            lines = []
            while not (serving := SERVING.fullmatch(lines[-1] if lines else "")):
                lines.append(demo.stdout.readline().strip())
                assert lines[-1] or demo.poll() is None, lines
            told = run_examples(*serving.groups())
        finally:
            os.killpg(demo.pid, signal.SIGTERM)
    assert [line.strip() for line in expected if line.strip() not in lines] == [expected[-1]]
    assert any(re.fullmatch(r"in a browser: \S+/calibrations/cal_\w+", line) for line in lines)
    assert not told, "".join(told)


def run_examples(url: str, key: str) -> list[str]:
    """Return what differs from what the page prints."""
    text = read_blocks("README.md", "python")[0].replace("<url>", url).replace("<key>", key)
    examples = doctest.DocTestParser().get_doctest(text, {}, "README.md", "README.md", 0)
    told: list[str] = []
    doctest.DocTestRunner().run(examples, out=told.append, clear_globs=False)
    examples.globs["client"].close()
    return told
