"""What the pages on the client tell people to type works, word for word, on a running service."""

import doctest
import os
import re
import shlex
import shutil
import subprocess
import sys

import pytest

import stilb
from stilb.commands.app import app
from tests.support.cards import write_card
from tests.support.compose import ROOT
from tests.support.frames import write_frame

COMMANDS, CLIENT = (
    (ROOT / "docs" / name).read_text(encoding="utf-8") for name in ("command-line.md", "client.md")
)
README = (ROOT / "README.md").read_text(encoding="utf-8")
LARGE = (800, 1000)  # above 1 MiB: the road of files that are sent in pieces
FIELD = {"signal_dn": 320.0, "seed": 99, "shape": LARGE}


def python_blocks(page: str) -> str:
    return "\n".join(re.findall(r"^```python\n(.*?)^```", page, re.MULTILINE | re.DOTALL))


@pytest.mark.skipif(shutil.which("sh") is None, reason="the commands are a shell's")
def test_every_command_from_card_to_what_is_in_force_is_true(live, shots, tmp_path):
    (block,) = re.findall(r"^```sh\n(.*?)^```", COMMANDS, re.MULTILINE | re.DOTALL)
    card = write_card(tmp_path / "card", [shot for shot in shots if "-3200-" in shot.path.name])
    (card / "field").mkdir()
    write_frame(card / "field" / "field.DNG", **FIELD | {"shape": (64, 96)})
    program = tmp_path / "bin" / "stilb"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m stilb "$@"\n')
    program.chmod(0o755)
    with live.team() as team:
        path = f"{program.parent}{os.pathsep}{os.environ['PATH']}"
        own = {"SERVICE": team.url, "KEY": team.key, "PATH": path, "PYTHONPATH": str(ROOT)}
        clean = {name: value for name, value in os.environ.items() if not name.startswith("STILB_")}
        done = subprocess.run(
            ["sh", "-euc", block],
            check=False,
            cwd=tmp_path,
            env=clean | own | {"XDG_CONFIG_HOME": str(tmp_path / "config")},
            capture_output=True,
            text=True,
        )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    assert "16 of 16 received, 0 pass" not in done.stdout
    assert "version 1 is in force from 2026-05-01T00:00:00Z on" in done.stdout
    assert "field.DNG" in done.stdout
    assert (tmp_path / "out" / "certificate.json").exists()


def test_every_example_of_the_client_is_true(live, shots, tmp_path, monkeypatch):
    with live.team() as team:
        campaign = team.campaign()
        few = [shot for shot in shots if "-3200-" in shot.path.name]
        for frame in team.push(campaign, few):
            team.client.wait(frame.job_id)
        version = team.client.calibrate(campaign.id)
        team.client.publish(version.id, valid_from="2026-04-01T00:00:00Z", reason="first")
        write_frame(tmp_path / "level-1.DNG", signal_dn=160.0, shape=LARGE)
        write_frame(tmp_path / "field.DNG", **FIELD)
        monkeypatch.chdir(tmp_path)
        monkeypatch.setenv("STILB_URL", team.url)
        monkeypatch.setenv("STILB_KEY", team.key)
        first = python_blocks(README).replace("<url>", team.url).replace("<key>", team.key)
        # the demo's camera and its figures are those of `make demo`
        first = re.sub(r"\d+\.\d\d\b", "...", first.replace("0K8TF1A0010042", "0K1XE8"))
        text = f"{first}>>> client.close()\n\n{python_blocks(CLIENT)}"
        examples = doctest.DocTestParser().get_doctest(text, {}, "client.md", "client.md", 0)
        runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
        told: list[str] = []
        runner.run(examples, out=told.append, clear_globs=False)
    assert len(examples.examples) > 20
    assert not told, "".join(told)


def test_examples_of_the_client_are_typed(tmp_path):
    """Those of README and of the page, also the ones that need another campaign than the page's."""
    examples = doctest.DocTestParser().get_examples(python_blocks(README) + python_blocks(CLIENT))
    indented = re.findall(r"^    ((?:\w+ = )?client\..+)\n", CLIENT, re.MULTILINE)
    path = tmp_path / "examples.py"
    path.write_text("".join(each.source for each in examples) + "\n".join(indented) + "\n")
    command = [
        sys.executable,
        "-m",
        "mypy",
        "--strict",
        "--config-file=",
        "--cache-dir",
        ROOT / ".mypy_cache/examples",
    ]
    typed = subprocess.run(
        [*command, path],
        check=False,
        cwd=ROOT,
        capture_output=True,
        text=True,
        env=os.environ | {"MYPYPATH": str(ROOT)},
    )
    assert len(indented) > 4
    assert typed.returncode == 0, typed.stdout


def test_every_command_has_its_row_and_every_row_its_command():
    groups = {group.name: group.typer_instance.registered_commands for group in app.registered_groups}
    names = {command.name for command in app.registered_commands}
    names |= {f"{group} {command.name}" for group, commands in groups.items() for command in commands}
    section = COMMANDS.partition("\n## Commands\n")[2].partition("\n## ")[0]
    told = set()
    for row in re.findall(r"^\| (.*?) \|", section, re.MULTILINE):
        for typed in re.findall(r"`([^`]+)`", row):
            words = [word for word in typed.removeprefix("stilb ").split() if word.islower()]
            told.add(" ".join(words) if words[0] != "show" else "campaign show")
    assert told == names


def test_every_name_of_the_package_is_there():
    assert sorted(stilb.__all__) == stilb.__all__
    assert all(hasattr(stilb, name) for name in stilb.__all__)
    for named in re.findall(r"`stilb\.([A-Z]\w+)", CLIENT):
        assert named in stilb.__all__
