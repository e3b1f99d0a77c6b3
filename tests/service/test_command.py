"""`stilb-server`: the help of each command does nothing, and what a command does not take is refused."""

import importlib
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from service import command
from service.command import COMMANDS


@pytest.fixture
def run(monkeypatch, capsys):
    """Run the command; what it would become is not started, and returned."""
    started = []

    def execv(_path, arguments):
        started.append(arguments[1:])
        return 0

    def run(*arguments):
        started.clear()
        monkeypatch.setattr("sys.argv", ["stilb-server", *arguments])
        try:
            code = command.main()
        except SystemExit as end:
            code = end.code
        return code, started[:], capsys.readouterr()

    monkeypatch.setattr("os.execv", execv)
    monkeypatch.setenv("PYTHONSAFEPATH", "")
    return run


@pytest.mark.parametrize("name", COMMANDS)
def test_help_shows_an_example_and_does_nothing(run, name):
    for asked in (["--help"], ["-h"]):
        code, started, said = run(name, *asked)
        assert (code, started, said.err) == (0, [], "")
        assert f"usage: stilb-server {name}" in said.out
        assert f"Example:\n  stilb-server {name}" in said.out


@pytest.mark.parametrize("name", COMMANDS)
def test_what_a_command_does_not_take_is_refused(run, name):
    code, started, said = run(name, "--no-such-option")
    assert (code, started, said.out) == (2, [], "")
    assert f"usage: stilb-server {name}" in said.err


def test_an_unknown_command_is_named(run):
    code, started, said = run("audits")
    assert (code, started) == (2, [])
    assert "invalid choice: 'audits' (choose from " in said.err


def test_a_command_becomes_its_module_with_its_arguments(run):
    for arguments in (
        ["up"],
        ["up", "service"],
        ["migrate", "--check"],
        ["key"],
        ["pulse", "http://127.0.0.1/livez"],
    ):
        code, started, _ = run(*arguments)
        (module,) = (COMMANDS[name].module for name in arguments[:1])
        assert (code, started) == (0, [["-m", module, *arguments[1:]]])
        assert importlib.util.find_spec(module) is not None


LINTS = tomllib.loads(Path("pyproject.toml").read_text())["tool"]["ruff"]["lint"]
LARGE = {
    *LINTS["flake8-tidy-imports"]["banned-module-level-imports"],
    *("imagecodecs", "rawpy", "scipy.stats", "typst"),
}


def test_processes_start_without_large_libraries():
    program = (
        "import sys, service.__main__, worker.upkeep, worker.background, store.migrate\n"
        "assert 'service.measurements.exports' in sys.modules\n"
        f"sys.exit(' '.join({LARGE} & sys.modules.keys()) or None)"
    )
    done = subprocess.run([sys.executable, "-c", program], check=False, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


def test_certificates_are_rendered_without_web_and_database():
    program = (
        "import sys, service.documents.rendering\n"
        "sys.exit(' '.join({'fastapi', 'starlette', 'sqlalchemy'} & sys.modules.keys()) or None)"
    )
    done = subprocess.run([sys.executable, "-c", program], check=False, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
