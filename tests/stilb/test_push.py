"""A push sends what is missing, goes on where it was, and tells what became of each file."""

import errno
import hashlib
import itertools
import os
import shutil
import signal
import subprocess
import sys
import threading
from collections import Counter
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta

import pytest

import stilb
from stilb.commands import push as commands
from stilb.commands.output import Exit
from stilb.commands.push import transfer
from tests.support.cards import write_card, write_plan
from tests.support.frames import write_frame
from tests.support.line import line_to


@pytest.fixture
def card(tmp_path, shots):
    """Five frames: a dark one, and a light one of each level."""
    return write_card(tmp_path / "card", [shot for shot in shots if "-3200-0" in shot.path.name])


@pytest.fixture
def ten(tmp_path, shots):
    """Ten frames, of two settings, as their verdicts need them."""
    few = [shot for shot in shots if "-3200-" in shot.path.name and not shot.path.stem.endswith("-2")]
    return write_card(tmp_path / "card", few)


@pytest.fixture
def campaign(team):
    return team.campaign()


@pytest.fixture
def uploads(live, monkeypatch):
    """How often each file went over the network, by its hash."""
    counts = Counter()
    app = live.house.app
    stack = app.middleware_stack or app.build_middleware_stack()

    async def counting(scope, receive, send):
        if scope["type"] == "http" and scope["method"] == "POST" and scope["path"].endswith("/frames"):
            counts[dict(scope["headers"])[b"x-content-sha256"].decode()] += 1
        await stack(scope, receive, send)

    monkeypatch.setattr(app, "middleware_stack", counting)
    return counts


def test_reasons_are_told_file_by_file(signed_in, campaign, ten):
    clipped = write_frame(ten / "level-1" / "clipped.DNG", signal_dn=9000.0)
    (ten / "level-9").mkdir()
    write_frame(ten / "level-9" / "lonely.DNG", signal_dn=900.0)
    (ten / "level-1" / "broken.DNG").write_bytes(b"no raw file")
    ended = signed_in("push", ten, "--campaign", campaign.id)
    assert ended.code == Exit.FINDINGS
    assert ended.out.splitlines()[-1] == "12 of 13 received, 5 pass, 5 warn, 1 fail, 1 pending"
    for said in (
        "level-1/broken.DNG  not received\n    no raw file, or damaged",
        f"level-1/{clipped.name}  fail\n",
        "100.00% of the region is clipped",
        "level-9/lonely.DNG  pending",
    ):
        assert said in ended.out
    told = signed_in("push", ten, "--campaign", campaign.id, "--json").json
    codes = {file["name"]: file["codes"] for file in told["files"]}
    assert codes["level-1/clipped.DNG"][0] == "clipped"


def test_pictures_and_half_copies_are_no_frames(signed_in, campaign, card, team):
    (card / "level-1" / "DJI_0001.JPG").write_bytes(b"a preview")
    (card / "level-1" / "._DJI_0001.DNG").write_bytes(b"half a copy")
    told = signed_in("push", card, "--campaign", campaign.id, "--no-wait", "--json").json
    assert (told["expected"], told["left_out"]) == (5, [])
    # in a night of measurements every raw file is a field frame, and a picture is none
    night = team.client.create_campaign(campaign.camera_id, kind="measurement")
    told = signed_in("push", card, "--campaign", night.id, "--no-wait", "--json").json
    assert (told["expected"], told["sent"], told["left_out"]) == (5, 5, [])
    assert {(frame.role, frame.scene) for frame in team.client.frames(night.id)} == {("field", None)}


def test_flat_card_is_sorted_as_the_page_sorts_it(signed_in, campaign, tmp_path, team):
    """Scenes by pauses, darks by their centre; a second card goes on with other scenes."""
    for n in range(8):
        taken_at = datetime(2026, 5, 1, 20, 0, 10 * (n % 4), tzinfo=UTC) + timedelta(minutes=5 * (n // 4))
        level = {"signal_dn": 0.0} if n > 5 else {}
        write_frame(tmp_path / "100MEDIA" / f"DJI_{n:04}.DNG", seed=n, taken_at=taken_at, **level)
    planned = tmp_path / "not begun"
    shutil.copytree(tmp_path / "100MEDIA", planned / "100MEDIA")
    signed_in("campaign", "init", planned)
    for folder, *named in (tmp_path / "100MEDIA",), (planned,), (planned, "--campaign", campaign.id):
        shown = signed_in("push", folder, *named, "--dry-run", "--json").json
        roles = [(each["role"], each["scene"]) for each in shown["files"]]
        assert roles == [("light", "Scene 1")] * 4 + [("light", "Scene 2")] * 2 + [("dark", "")] * 2
    (planned / "cut.DNG").write_bytes(b"")
    assert signed_in("push", planned, "--dry-run").out.endswith("left out: cut.DNG; nothing was sent\n")
    assert f"stilb campaign run '{planned}'" in signed_in("push", planned).err
    shutil.rmtree(planned)
    assert list(team.client.frames(campaign.id)) == []
    signed_in("push", tmp_path, "--campaign", campaign.id)
    later = write_frame(tmp_path / "more" / "DJI_0009.DNG", taken_at=datetime(2026, 5, 1, 23, tzinfo=UTC))
    signed_in("push", later.parent, "--campaign", campaign.id)
    assert Counter(frame.scene for frame in team.client.frames(campaign.id)) == {
        "Scene 1": 4,
        "Scene 2": 2,
        None: 2,
        "Scene 3": 1,
    }


def test_one_role_for_a_whole_folder_and_a_frame_that_was_said_to_be_another(signed_in, campaign, card, team):
    named = ("--campaign", campaign.id)
    ended = signed_in("push", card / "level-2", *named, "--role", "light", "--scene", "bright")
    assert "1 of 1 received" in ended.out
    assert {(frame.role, frame.scene) for frame in team.client.frames(campaign.id)} == {("light", "bright")}
    ended = signed_in("push", card / "level-2", *named, "--role", "dark", "--no-wait")
    assert "exists already as light of bright" in ended.out
    assert "here it is dark" in ended.out


def test_the_same_bytes_under_two_names_go_once(signed_in, campaign, card):
    source = next((card / "dark").iterdir())
    # a name that is no UTF-8, as an old system wrote it
    (card / "dark" / os.fsdecode(b"copy\xff.DNG")).write_bytes(source.read_bytes())
    told = signed_in("push", card, "--campaign", campaign.id, "--no-wait", "--json").json
    assert "dark/copy?.DNG" in {file["name"] for file in told["files"]}
    assert (told["expected"], told["received"], told["sent"]) == (6, 6, 5)


def test_a_file_that_cannot_be_read_does_not_keep_the_others(signed_in, campaign, card, monkeypatch):
    bad = next((card / "level-3").iterdir())
    monkeypatch.setattr("hashlib.file_digest", _refusing(bad))
    ended = signed_in("push", card, "--campaign", campaign.id)
    assert ended.code == Exit.FINDINGS
    assert ended.out.splitlines()[-1].startswith("4 of 5 received")
    assert f"level-3/{bad.name}  not received\n    the card is loose" in ended.out


def _refusing(bad):
    honest = hashlib.file_digest

    def digest(file, name):
        if file.name == str(bad):
            raise OSError("the card is loose")
        return honest(file, name)

    return digest


def test_a_folder_goes_over_and_a_cut_connection_is_taken_up_again(stilb_command, team, campaign, ten):
    """It is told in one line; roles and scenes follow from its folders."""
    with line_to(team.url) as line:
        assert stilb_command("login", line.url, "--key", team.key).code == Exit.DONE
        line.cut_after = 30_000
        ended = stilb_command("push", ten, "--campaign", campaign.id)
        assert line.cuts == 1
    assert ended.code == Exit.DONE, ended.err
    assert ended.out.splitlines()[-1] == "10 of 10 received, 6 pass, 4 warn"
    assert "; retry in 1 s" in ended.err
    said = Counter((frame.role, frame.scene) for frame in team.client.frames(campaign.id))
    lights = {("light", f"level-{n}"): 2 for n in (1, 2, 3, 4)}
    assert said == {("dark", None): 2, **lights}


def test_killed_in_the_middle_it_goes_on_and_sends_nothing_twice(signed_in, campaign, ten, team, live):
    """The service lets only some uploads come to their end before the laptop's battery is pulled."""
    command = [sys.executable, "-m", "stilb", "push", str(ten), "--campaign", campaign.id]
    # the line ends first: what it still carries is held as well
    with _stopping(live, after=4) as stopped, line_to(team.url) as line:
        process = subprocess.Popen(
            [*command, "--url", line.url, "--key", team.key], stderr=subprocess.DEVNULL
        )
        assert stopped.wait(60)
        process.send_signal(signal.SIGKILL)
        assert process.wait() == -signal.SIGKILL
    there = {frame.sha256 for frame in team.client.frames(campaign.id)}
    assert len(there) == 4
    told = signed_in("push", ten, "--campaign", campaign.id, "--json").json
    assert (told["received"], told["sent"]) == (10, 6)
    assert told["outcomes"] == {"pass": 6, "warn": 4}


@contextmanager
def _stopping(live, *, after):
    """After so many uploads no other comes to its end; the event says that those have been answered."""
    app, stopped, begun, ended = live.house.app, threading.Event(), itertools.count(), itertools.count(1)
    stack = app.middleware_stack

    async def stopping(scope, receive, send):
        if scope["type"] != "http" or scope["method"] != "POST" or not scope["path"].endswith("/frames"):
            await stack(scope, receive, send)
        elif next(begun) >= after:
            await _hang(receive)
        else:
            await stack(scope, receive, send)
            if next(ended) == after:
                stopped.set()

    app.middleware_stack = stopping
    yield stopped
    app.middleware_stack = stack


async def _hang(receive):
    """Until the sender is gone."""
    while (await receive())["type"] != "http.disconnect":
        pass


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (("--campaign", "P-99"), Exit.NOT_FOUND, "stilb campaign list"),
        ((), Exit.USAGE, "stilb campaign init"),
        (
            ("--campaign", "c", "--role", "bright"),
            Exit.USAGE,
            "'bright' is not a role; use one of light, dark",
        ),
        (("--campaign", "c", "--scene", "level-1"), Exit.USAGE, "--scene needs --role"),
        (
            ("--campaign", "c", "--url", "http://127.0.0.1:9", "--key", "k"),
            Exit.NETWORK,
            "run this again: it continues",
        ),
    ],
)
def test_a_push_that_cannot_begin_says_why(signed_in, card, monkeypatch, arguments, code, said):
    monkeypatch.setattr("stilb.transport._LONGEST_PAUSE_S", 0.01)
    ended = signed_in("push", card, *arguments)
    assert (ended.code, ended.out) == (code, "")
    assert said in " ".join(ended.err.split())


def test_a_campaign_by_its_project_number(signed_in, team, card, tmp_path):
    write_plan(card)
    ended = signed_in("push", card)
    assert (ended.code, "stilb campaign run" in ended.err) == (Exit.NOT_FOUND, True)
    camera = team.client.find_camera(team.campaign().raw["camera_id"])
    named = team.client.create_campaign(camera.id, project_number="P-17")
    (tmp_path / "empty").mkdir()
    ended = signed_in("push", tmp_path / "empty", "--campaign", "P-17")
    assert (ended.code, "It contains no raw files" in ended.err) == (Exit.USAGE, True)
    told = signed_in("push", card, "--campaign", "P-17", "--no-wait", "--json").json
    assert told["campaign_id"] == named.id
    team.client.create_campaign(camera.id, project_number="P-17")
    ended = signed_in("push", card, "--campaign", "P-17")
    assert ended.code == Exit.USAGE
    assert named.id in ended.err


def test_watching_sends_what_has_settled(signed_in, campaign, ten, tmp_path, monkeypatch, uploads):
    """Each pause is a moment on site: a copy that grows, another file, the end."""
    watched = tmp_path / "watched"
    (watched / "dark").mkdir(parents=True)
    first, second = sorted((ten / "dark").iterdir())
    whole = first.read_bytes()
    target = watched / "dark" / first.name
    seen = []

    def copy_half():
        target.write_bytes(whole[:100])

    def copy_rest():
        seen.append(dict(uploads))
        target.write_bytes(whole)

    def copy_second():
        seen.append(dict(uploads))
        (watched / "dark" / second.name).write_bytes(second.read_bytes())

    moments = iter([copy_half, copy_rest, lambda: None, copy_second, lambda: None, lambda: None, _end])
    monkeypatch.setattr("stilb.commands.push.sleep", lambda _: next(moments)())
    ended = signed_in("push", watched, "--campaign", campaign.id, "--watch", "--json")
    assert [len(each) for each in seen] == [0, 1]
    assert (ended.code, ended.json["received"], ended.json["sent"]) == (Exit.DONE, 2, 2)
    assert set(uploads.values()) == {1}


@pytest.fixture
def watch(signed_in, card, campaign, monkeypatch):
    """Watch the card for so many moments, and end it."""

    def run(moments, *options, folder=card):
        passing = iter([*[lambda: None] * moments, _end])
        monkeypatch.setattr(commands, "sleep", lambda _: next(passing)())
        return signed_in("push", folder, "--campaign", campaign.id, *options, "--watch", "--json")

    return run


def _failing(problems, act):
    """It raises these first, one each time; what is None is no problem."""
    ahead = iter(problems)

    def fail(*given, **more):
        if (problem := next(ahead, None)) is not None:
            raise problem
        return act(*given, **more)

    return fail


AWAY = stilb.Problem(status=0, code="unreachable", detail="no network", retryable=True)


def test_a_network_that_is_lost_while_watching_comes_back(watch, monkeypatch):
    """The service is away at the start and once more at the first file; nobody has to start again."""
    monkeypatch.setattr(commands, "_find_campaign", _failing([AWAY, AWAY], commands._find_campaign))
    monkeypatch.setattr(commands, "transfer", _failing([AWAY], transfer))
    ended = watch(5)
    assert ended.err.count("waiting for the service, stop with Ctrl-C") == 1
    assert "these files are sent again at the next check" in ended.err
    assert (ended.code, ended.json["received"], ended.json["sent"]) == (Exit.DONE, 5, 5)


def test_a_watch_survives_a_card_that_is_pulled_out(watch, card, monkeypatch):
    """Of a card that is loose the system reads nothing; the next look finds it again."""
    loose = OSError(errno.EIO, "Input/output error", str(card))
    monkeypatch.setattr(commands, "sort_files", _failing([None, loose], commands.sort_files))
    ended = watch(5, "--role", "dark", folder=card / "dark")
    assert f"Input/output error: {card}; the folder is looked at again" in ended.err
    assert (ended.code, ended.json["received"]) == (Exit.DONE, 1)


def test_a_watch_that_ends_without_a_network_tells_what_was_not_sent(watch, monkeypatch):
    monkeypatch.setattr(commands, "transfer", _failing(itertools.repeat(AWAY), transfer))
    ended = watch(2)
    assert (ended.code, ended.json["expected"], ended.json["received"]) == (Exit.FINDINGS, 5, 0)
    assert "run the same command again" in ended.json["files"][0]["reasons"][0]
    assert "receipt" not in ended.json


def _end():
    raise KeyboardInterrupt
