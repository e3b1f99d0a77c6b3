"""What the page on the client prints works, word for word, on a running service."""

import doctest
import re
import subprocess
import sys

import stilb
from stilb.commands.app import app
from tests.support.compose import ROOT
from tests.support.frames import write_frame
from tests.support.printed import read_blocks

COMMANDS, CLIENT = (
    (ROOT / "docs" / name).read_text(encoding="utf-8") for name in ("command-line.md", "client.md")
)
LARGE = (720, 800)  # above 1 MiB: the road of files that are sent in pieces
SESSION = [block for block in read_blocks("docs/client.md", "python") if block.startswith(">>> ")]
CALIBRATE, VIGNETTING = (block for block in read_blocks("docs/client.md", "python") if block not in SESSION)


def test_every_example_of_the_client_is_true(live, shots, tmp_path, monkeypatch):
    with live.team() as team:
        campaign = team.campaign()
        few = [shot for shot in shots if "-3200-" in shot.path.name and not shot.path.stem.endswith("-2")]
        for frame in team.push(campaign, few):
            team.client.wait(frame.job_id)
        names = {
            "client": team.client,
            "campaign": campaign,
            "camera": team.client.camera(campaign.camera_id),
        }
        monkeypatch.chdir(tmp_path)
        monkeypatch.setenv("STILB_URL", team.url)
        monkeypatch.setenv("STILB_KEY", team.key)
        exec(CALIBRATE, names)
        write_frame(tmp_path / "level-1.DNG", signal_dn=160.0, shape=LARGE)
        write_frame(tmp_path / "field.DNG", signal_dn=320.0, seed=99, shape=LARGE)
        examples = doctest.DocTestParser().get_doctest("\n".join(SESSION), {}, "client.md", "client.md", 0)
        runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
        told: list[str] = []
        runner.run(examples, out=told.append, clear_globs=False)
        for seed in (1, 2):
            write_frame(tmp_path / f"f2-{seed}.DNG", f_number=2.0, seed=seed, shape=LARGE)
        exec(VIGNETTING, names)
    assert (tmp_path / "correction.tif").stat().st_size
    assert len(examples.examples) > 20
    assert not told, "".join(told)


def test_examples_in_python_are_typed(tmp_path):
    """Those of README, of the client's page and of dashboards, whose programs have no types."""
    readme = read_blocks("README.md", "python")
    examples = doctest.DocTestParser().get_examples("\n".join([*readme, *SESSION]))
    boards = read_blocks("docs/dashboards.md", "python")
    path = tmp_path / "examples.py"
    # as strict as `make lint`, which has read the client before
    lax = '# mypy: disable-error-code="import-not-found, import-untyped"'
    path.write_text("\n".join([lax, *(each.source for each in examples), CALIBRATE, VIGNETTING, *boards]))
    command = [sys.executable, "-m", "mypy", path]
    typed = subprocess.run(command, check=False, cwd=ROOT, capture_output=True, text=True)
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
