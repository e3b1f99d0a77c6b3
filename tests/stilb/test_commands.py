"""Each command asks, answers a person and a machine, and ends with the code that is documented."""

import csv
import json
import re
from datetime import UTC, datetime, timedelta
from email.utils import format_datetime
from unittest.mock import Mock

import pytest
import typer

import stilb
from stilb.commands.access import examine_health
from stilb.commands.app import app
from stilb.commands.calibration import list_reasons, show_rig
from stilb.commands.output import Exit, exit_of, next_step, read_moment
from stilb.resources.organisation import _clock_ahead_s
from store.software import read_version
from tests.support.campaigns import K_TRUE
from tests.support.compose import ROOT
from tests.support.frames import write_frame
from tests.support.roads import MARKS, REQUIREMENT, SITE, list_points, write_road_frame

PUBLISHED = "2026-04-01T00:00:00Z"


@pytest.fixture(scope="module")
def calibrated(live, shots):
    """A team with a version in force and a frame of the field; nobody changes it."""
    with live.team() as team:
        campaign = team.campaign()
        frames = team.push(campaign, [shot for shot in shots if not shot.path.stem.endswith("-2")])
        for frame in frames:
            team.client.wait(frame.job_id)
        version = team.client.calibrate(campaign.id)
        team.client.publish(version.id, valid_from=PUBLISHED, reason="first")
        path = write_frame(live.house.folder / "field.DNG", signal_dn=320.0, seed=99)
        field = team.client.push(campaign.id, path, role="field")
        team.client.wait(field.job_id)
        yield team, campaign, version, field


@pytest.fixture
def command(calibrated, stilb_command, monkeypatch):
    team = calibrated[0]
    monkeypatch.setenv("STILB_URL", team.url)
    monkeypatch.setenv("STILB_KEY", team.key)
    return stilb_command


def test_k_of_a_camera_by_its_serial_and_where_there_is_none(command, calibrated):
    _, _, version, _ = calibrated
    items = command("k", "0K1XE8", "--json").json["items"]
    assert [(item["name"], item["iso"]) for item in items] == [("luminance_k", 3200), ("luminance_k", 6400)]
    shown = command("k", version.camera_id, "--iso", 6400).out
    assert ("6400" in shown, "3200" in shown, "version 1 is in force" in shown) == (True, False, True)
    ended = command("k", "0K1XE8", "--at", "2026-03-31", "--json")
    assert (ended.code, ended.json["error"]["code"]) == (Exit.NOT_FOUND, "no_calibration_in_force")
    assert "stilb publish" in ended.err
    ended = command("k", "DJI")
    assert (ended.code, "Registered: DJI FC6520 0K1XE8" in ended.err) == (Exit.NOT_FOUND, True)


def test_verdict_on_a_fleet_of_which_one_camera_has_no_version(command, calibrated):
    other = calibrated[0].client.create_camera("DJI", "FC6520", "a second one")
    ended = command("fleet", "luminance", "0K1XE8", other.id, "--tolerance", 0.04)
    assert ended.code == Exit.DONE
    assert "luminance_k, ISO 3200" in ended.out
    assert "cannot tell" in ended.out
    assert "a second one" in ended.out


def test_the_client_gives_one_k(calibrated):
    team, _, version, _ = calibrated
    k = team.client.k(camera="0K1XE8", iso=3200)
    assert (k.calibration_id, k.iso, k.unit) == (version.id, 3200, "DN*m2/(cd*s)")
    assert abs(k.value - K_TRUE) <= 3 * k.standard_uncertainty
    assert team.client.k(camera="DJI FC6520 0K1XE8", iso=3200, at=datetime(2026, 5, 1, tzinfo=UTC)) == k
    with pytest.raises(stilb.Unclear, match="3200, 6400"):
        team.client.k(camera="0K1XE8")


CORNERS = "10,10 80,10 80,50 10,50"


def test_measure_a_frame_and_save_its_map(command, calibrated, tmp_path):
    _, _, _, field = calibrated

    def measure(*options):
        return command("measure", field.id, *options, "--json").json["items"]

    # the signal over K t S / f^2, by hand: 320 / (2.0 * 0.01 * 3200 / 16) = 80 cd/m2
    (item,) = measure("--map", tmp_path / "maps", "--stac")
    path = tmp_path / "maps" / f"field-{item['id']}.json"
    saved = json.loads(path.read_text())
    # no lens is known of this camera: where its picture lies is not either
    assert (saved["geometry"], saved["assets"]["map"]["href"]) == (None, f"./field-{item['id']}.tif")
    mean = item["mean"]
    assert abs(mean["value"] - 80.0) <= 3 * mean["standard_uncertainty"]
    assert path.with_suffix(".tif").read_bytes()[:2] in {b"II", b"MM"}
    command("map", item["id"], "--levels", "60,80", "--save", tmp_path / "read")
    lines = json.loads((tmp_path / "read" / f"{item['id']}-isolines.geojson").read_text())
    assert [each["properties"]["level"] for each in lines["features"]] == [60.0, 80.0]
    (grid,) = measure("--grid", f"2x3 {CORNERS}")
    assert [len(row) for row in grid["grid"]["cells"]] == [3, 3]
    assert (item["region_origin"], grid["region_origin"]) == ("campaign", "grid")
    lanes = measure("--lanes", f"1x3.5x40 {CORNERS}", "--cells", tmp_path / "cells", "--report", tmp_path)
    assert sorted(path.suffix for path in (tmp_path / "cells").iterdir()) == [".csv", ".geojson"]
    assert (tmp_path / f"field-{lanes[0]['id']}.pdf").read_bytes().startswith(b"%PDF-")
    assert [len(row) for row in lanes[0]["grid"]["cells"]] == [14, 14, 14]
    refused = command("compare", item["id"], grid["id"])
    assert (refused.code, "--other-region" in refused.err) == (Exit.REFUSED, True)
    assert "The two regions differ" in command("compare", item["id"], grid["id"], "--other-region").out
    (tmp_path / "road.csv").write_text("nm,value\n" + "".join(f"{nm},1\n" for nm in range(380, 781, 10)))
    stated = ("--light", tmp_path / "road.csv", "--mains", 50, "--glare", 0.01, "--mismatch", 0.03)
    (lit,) = measure(*stated)
    assert lit["parameters"]["conditions"]["light_source"].startswith("nm,value")
    assert {each["source"]: each["u_rel"] for each in lit["corrections"]}["spectral mismatch"] == 0.03
    assert lit["mean"]["value"] < mean["value"]
    assert command("measure", field.id, "--light", "HP9").code == Exit.REFUSED
    shown = command("measure", field.id, "--region", "10,10 20,10 20,20", "--reflectance", 0.1).out
    assert ("field.DNG" in shown, "cd/m2" in shown) == (True, True)


def test_measure_a_campaign(command, calibrated, tmp_path):
    _, campaign, _, field = calibrated
    told = command("measure", "--campaign", campaign.id, "--json").json
    assert ([item["frame_id"] for item in told["items"]], told["not_measured"]) == ([field.id], [])
    # with a region of each frame, in the same command
    path = tmp_path / "regions.csv"
    path.write_text(f'frame,region\n{field.filename},"20,16 60,16 60,40 20,40"\n')
    regions = ("measure", "--campaign", campaign.id, "--regions", path)
    (again,) = command(*regions, "--json").json["items"]
    assert (again["region"], again["region_origin"]) == ([[20, 16], [60, 16], [60, 40], [20, 40]], "frame")
    assert "give either --region" in command(*regions, "--region", "1,1 9,1 9,9").err
    path.write_text('no such frame.DNG,"1,1 9,1 9,9"\n')
    assert "no frame is called 'no such frame.DNG'" in command(*regions).err


def test_night_goes_from_card_to_measurements(command, calibrated, tmp_path):
    """In one command and with the grid of its file, from a template in which every line can be used."""
    team, *_ = calibrated
    folder = tmp_path / "night"
    (folder / "level-1").mkdir(parents=True)
    # a folder that would be a light level elsewhere
    write_frame(folder / "level-1" / "a.DNG", signal_dn=320.0, exposure_time_s=0.01, f_number=4.0, iso=3200)
    named = ("--make", "DJI", "--model", "FC6520", "--serial", "0K1XE8", "--project", "Mill Road")
    assert command("campaign", "init", folder, "--night", *named).code == Exit.DONE
    path = folder / "campaign.toml"
    assert "[fit]" not in path.read_text()
    head, table, measure = path.read_text().partition("[measure]")
    full = head + table + re.sub(r"^# (?=\w+ = )", "", measure, flags=re.MULTILINE)
    grid = "grid = { corners = [[10, 10], [80, 10], [80, 50], [10, 50]], rows = 2, columns = 3 }\n"
    path.write_text(full + grid)
    ended = command("campaign", "run", folder, "--json")
    assert ended.code == Exit.DONE, ended.err
    (found,) = ended.json["measurements"]
    assert (found["filename"], len(found["grid"]["cells"])) == ("a.DNG", 2)
    made = team.client.find_campaign("Mill Road")
    assert (made.kind, [each.role for each in team.client.frames(made.id)]) == ("measurement", ["field"])
    assert "1 measured" in command("campaign", "show", "Mill Road").out
    assert command("calibrate", made.id).code == Exit.REFUSED
    path.write_text(full + grid + "[fit]\n")
    assert "[fit] has no place in a campaign of the kind measurement" in command("push", folder).err
    path.unlink()
    again = command("push", folder, "--campaign", "Mill Road", "--json").json
    assert (again["sent"], again["received"]) == (0, 1)
    write_frame(folder / "b.DNG", signal_dn=320.0, exposure_time_s=0.01, f_number=4.0, iso=100)
    saved = tmp_path / "night.csv"
    given = ("--campaign", "Mill Road", "--region", "10,10 80,10 80,50", "--save", saved)
    ended = command("measure", folder, *given, "--json")
    assert ended.code == Exit.FINDINGS
    assert [each["filename"] for each in ended.json["items"]] == ["a.DNG"]
    assert [each["code"] for each in ended.json["not_measured"]] == ["iso_not_calibrated"]
    assert "measured: 1 of 1" in ended.err
    table = list(csv.DictReader(saved.read_text().splitlines()))
    assert [row["filename"] for row in table] == ["a.DNG", "a.DNG"]
    with pytest.raises(FileNotFoundError, match="no such folder"):
        team.client.save_measurements(made.id, tmp_path / "none" / "night.csv")
    rows = json.loads(team.client.save_measurements(made.id, tmp_path / "night.json").read_text())["rows"]
    assert [row["filename"] for row in rows] == ["a.DNG", "a.DNG"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("measure",), "give the ids of frames, a folder to send, or --campaign"),
        (("measure", "a.JPG"), "a.JPG is the name of a file, which is not here, and not the id of a frame"),
        (("measure", "f", "--average"), "--average needs two frames or more"),
        (("measure", "f", "--grid", "3x5 1,2"), "--grid needs rows x columns and four corners"),
        (("measure", "f", "--region", "1,2"), "--region needs three corners or more"),
        (("measure", "f", "--lanes", "1x3.5 10,10 80,10"), "lanes x width x spacing"),
        (("map", "m", "--levels", "x"), "--levels needs numbers"),
        (("roi", "c", "--polygon", "1,2 3,4 5,6", "--imagej", "makePolygon()"), "give either"),
        (("calibrate", "c", "--set", "x"), "must be written as NAME=VALUE"),
        (("calibrate", "c", "--tolerance", "4"), "--tolerance is a fraction: 0.04 for 4 %"),
        (("k", "0K1XE8", "--at", "yesterday"), "'yesterday' is not a time: give a day"),
        (("k", "0K1XE8", "--at", "2026-13-01"), "is not a time: give a day"),
        (("k", "0K1XE8", "--at", "2026-05-01T20:00:00"), "a time with its zone"),
        (("k",), "Missing argument"),
        (("jobs", "--limit", "0"), "--limit"),
    ],
)
def test_what_is_typed_wrong(command, arguments, message):
    ended = command(*arguments)
    assert (ended.code, ended.out) == (Exit.USAGE, "")
    assert message in " ".join(re.sub("[│|]", " ", ended.err).split())


def test_a_region_is_set_and_shown(signed_in, team, tmp_path):
    campaign = team.campaign()
    assert signed_in("roi", campaign.id).out == "8,8 88,8 88,56 8,56\n"
    signed_in("roi", campaign.id, "--polygon", "8,8 80,8 80,56")
    assert signed_in("roi", campaign.id, "--json").json["polygon"] == [[8, 8], [80, 8], [80, 56]]
    macro = tmp_path / "roi.ijm"
    macro.write_text("makePolygon(9,9,70,9,70,50);\n")
    assert signed_in("roi", campaign.id, "--imagej", macro).out == "9,9 70,9 70,50\n"
    assert signed_in("roi", campaign.id, "--imagej", "makePolygon(1,1").code == Exit.REFUSED
    lost = signed_in("roi", campaign.id, "--imagej", tmp_path / "none.ijm")
    assert (lost.code, "neither makePolygon(...) nor an existing file" in lost.err) == (Exit.USAGE, True)
    macro.write_bytes(b"Iout\x00\xe4\x00\x00")
    assert "contains no macro: record one in ImageJ" in signed_in("roi", campaign.id, "--imagej", macro).err


def test_a_frame_has_a_region_of_its_own(signed_in, team, shots):
    campaign = team.campaign()
    frames = team.push(campaign, shots[:2])
    moved = ("--frame", shots[0].path.name, "--frame", frames[1].id)
    told = signed_in("roi", campaign.id, *moved, "--polygon", "8,8 80,8 80,56").out
    assert "their own region, being read again: 2" in told
    signed_in("roi", campaign.id, *moved[:2], "--imagej", "makePolygon(9,9,70,9,70,50)")
    first, second = (frame.raw["roi_id"] for frame in team.client.frames(campaign.id))
    assert first != second
    assert campaign.raw.get("roi_id") not in {first, second}
    unknown = signed_in("roi", campaign.id, "--frame", "x", "--polygon", "1,1 9,1 9,9").err
    assert "no frame is called 'x'" in unknown
    assert "needs --polygon" in signed_in("roi", campaign.id, *moved).err


def test_calibrate_with_a_frame_left_out_and_see_what_publishing_changes(command, calibrated):
    team, campaign, version, _ = calibrated
    frame = next(frame for frame in team.client.frames(campaign.id) if frame.role == "light")
    said = ("--tolerance", 0.05, "--model", "proportional", "--set", "channel=grey")
    said += ("--set", "f_number_u_rel=0.02", "--exclude", f"{frame.filename}=a moth")
    draft = command("calibrate", campaign.id, *said, "--json").json
    used = {"tolerance_rel": 0.05, "channel": "grey", "f_number_u_rel": 0.02}
    assert used.items() <= draft["parameters"].items()
    (point,) = [point for point in draft["points"] if point["frame_id"] == frame.id]
    assert "a moth" in point["left_out"]
    assert f"{version.id}: version 1, published" in command("calibrate", campaign.id).out
    unknown = " ".join(command("calibrate", campaign.id, "--exclude", "x.DNG=r").err.split())
    assert "no frame is called 'x.DNG'" in unknown
    assert "stilb publish cal_" in command("calibrate", campaign.id, "--set", "channel=grey").out
    ended = command("publish", version.id, "--from", "2026-05-01", "--reason", "r", "--dry-run")
    assert "publishing it changes nothing there" in ended.out
    assert "the certificate lacks: The customer is missing" in ended.out


def test_export_lays_everything_down(command, calibrated, tmp_path):
    *_, version, _ = calibrated
    ended = command("export", version.id, tmp_path / "out", "--json")
    assert ended.json == {"folder": str(tmp_path / "out")}
    assert re.search(r"^20/20 ", ended.err, re.MULTILINE)
    assert (tmp_path / "out" / "certificate.json").exists()
    unknown = command("export", "cal_x", tmp_path / "none")
    assert (unknown.code, unknown.out) == (Exit.NOT_FOUND, "")


def test_jobs_and_one_of_them(command, calibrated):
    _, _, _, field = calibrated
    found = command("jobs", "--kind", "extract", "--limit", 3, "--json").json["items"]
    assert [job["kind"] for job in found] == ["extract"] * 3
    shown = command("jobs", field.job_id, "--wait")
    assert (shown.code, "extract succeeded 100%" in shown.out) == (Exit.DONE, True)
    listed = command("jobs", "--state", "succeeded").out
    assert "field.DNG" in listed
    assert "succeeded" in listed


def test_a_failed_job_is_a_finding(command, calibrated, tmp_path):
    team, campaign, *_ = calibrated
    (tmp_path / "broken.DNG").write_bytes(b"no raw file")
    frame = team.client.push(campaign.id, tmp_path / "broken.DNG", role="field")
    with pytest.raises(stilb.JobFailed):
        team.client.wait(frame.job_id)
    ended = command("jobs", frame.job_id)
    assert ended.code == Exit.FINDINGS
    assert "failed" in ended.out
    for words, said in [
        ((frame.job_id,), "extract queued"),
        (("--state", "failed", "--code", "not_a_raw_file", "--campaign", campaign.id), "retried: 1 job\n"),
    ]:
        again = command("retry", *words)
        assert (again.code, said in again.out) == (Exit.DONE, True)
        with pytest.raises(stilb.JobFailed):
            team.client.wait(frame.job_id)
    assert command("dismiss", "--state", "failed", "--campaign", campaign.id).out == "dismissed: 1 job\n"
    assert command("dismiss", "--state", "failed", "--undo", "--json").json == {"dismissed": 1}
    assert command("retry", "--state", "failed", "--kind", "fit", "--json").json == {"retried": 0}
    assert command("retry").code == command("retry", frame.job_id, "--state", "failed").code == Exit.USAGE


def test_doctor_finds_a_service_well(command):
    ended = command("doctor", "--json")
    checks = {check["check"]: check["state"] for check in ended.json["checks"]}
    assert list(checks) == ["ready", "version", "queue", "quarantine", "disk", "clock", "key"]
    assert (checks["ready"], checks["version"], checks["clock"], checks["key"]) == ("ok",) * 4
    assert ended.json["version"] == read_version()
    assert abs(ended.json["clock_ahead_s"]) < 60


HEALTHY = {"ready": True, "detail": "d", "answered_in_s": 0.1, "clock_ahead_s": 0.2, "version": "1"}
HEALTHY |= {"oldest_queued_s": 1.0, "quarantined_jobs": 0, "free_bytes": 10**12}


@pytest.mark.parametrize(
    ("changes", "check", "state"),
    [
        ({"ready": False}, "ready", "fail"),
        ({"oldest_queued_s": 61.0}, "queue", "warn"),
        ({"quarantined_jobs": 1}, "quarantine", "warn"),
        ({"free_bytes": 19 * 10**9}, "disk", "warn"),
        ({"free_bytes": 10**8}, "disk", "fail"),
        ({"clock_ahead_s": -6.0}, "clock", "warn"),
        ({"clock_ahead_s": 301.0}, "clock", "fail"),
        ({"clock_ahead_s": None}, "clock", "unknown"),
        ({"version": None}, "version", "unknown"),
        ({"free_bytes": None}, "disk", "unknown"),
        ({"oldest_queued_s": None}, "queue", "unknown"),
        ({"quarantined_jobs": None}, "quarantine", "unknown"),
    ],
)
def test_doctor_judges(changes, check, state):
    assert {finding.state for finding in examine_health(stilb.Health(**HEALTHY))} == {"ok"}
    findings = {each.check: each.state for each in examine_health(stilb.Health(**HEALTHY | changes))}
    assert findings == {**dict.fromkeys(findings, "ok"), check: state}


def test_clock_is_compared_at_the_middle_of_the_request():
    """The header's seconds are cut off: half of one is added."""
    sent_at = datetime(2026, 5, 1, 20, tzinfo=UTC)
    there = format_datetime(sent_at + timedelta(seconds=3), usegmt=True)
    assert _clock_ahead_s(there, sent_at, 2.0) == 3.0 + 0.5 - 1.0
    assert _clock_ahead_s("soon", sent_at, 2.0) is None


def test_doctor_where_a_proxy_keeps_the_metrics_and_the_clock_is_wrong(stilb_command, service):
    there = format_datetime(datetime.now(UTC) + timedelta(hours=1), usegmt=True)
    service.will_answer({"status": "ok"}, headers={"Date": there})
    service.will_refuse(404, "not_found")
    own = {"id": "k", "name": "n", "scopes": ["read"], "organisation": {"id": "o", "name": "O"}}
    service.will_answer(own)
    ended = stilb_command("doctor", "--url", service.url, "--key", "k", "--json")
    states = {check["check"]: check["state"] for check in ended.json["checks"]}
    assert (ended.code, states["clock"], states["queue"], states["disk"]) == (1, "fail", "unknown", "unknown")
    assert "behind the service's" in ended.out


@pytest.mark.parametrize(
    ("error", "code"),
    [
        ((0, "unreachable"), Exit.NETWORK),
        ((401, "unauthenticated"), Exit.KEY),
        ((403, "scope_missing"), Exit.KEY),
        ((404, "not_found"), Exit.NOT_FOUND),
        ((409, "conflict"), Exit.REFUSED),
        ((422, "roi_empty"), Exit.REFUSED),
        ((503, "storage_unavailable"), Exit.SERVER),
        (stilb.Unclear("which"), Exit.USAGE),
        (FileNotFoundError("x"), Exit.USAGE),
        (TimeoutError("job"), Exit.STILL_AT_WORK),
        (ZeroDivisionError(), Exit.BROKEN),
    ],
)
def test_every_error_has_its_code(error, code):
    if isinstance(error, tuple):
        status, name = error
        error = stilb.Problem(status=status, code=name, detail="", retryable=status in {0, 503})
    assert exit_of(error) == code
    if code in {Exit.NETWORK, Exit.KEY, Exit.SERVER, Exit.STILL_AT_WORK}:
        assert next_step(error)


def test_a_fault_of_ours_looks_like_no_finding(stilb_command, monkeypatch):
    monkeypatch.setattr("stilb.commands.output.read_login", lambda _: 1 / 0)
    ended = stilb_command("whoami", "--json")
    assert (ended.code, json.loads(ended.out)["error"]["exit_code"]) == (Exit.BROKEN, 70)
    assert "Traceback" in ended.err


def test_every_exit_code_is_told():
    text = (ROOT / "docs" / "command-line.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\d+) \| .+ \|$", text, re.MULTILINE)
    assert sorted(map(int, rows)) == sorted(Exit)


def test_times_as_people_type_them():
    assert read_moment("2026-05-01") == "2026-05-01T00:00:00Z"
    assert read_moment("2026-05-01T20:00:00+02:00") == "2026-05-01T20:00:00+02:00"
    assert abs(datetime.fromisoformat(read_moment("now")) - datetime.now(UTC)) < timedelta(minutes=1)
    assert read_moment(None) is None


def test_now_is_the_services_when_a_version_is_published(command, calibrated, monkeypatch):
    *_, version, _ = calibrated
    monkeypatch.setattr(
        "stilb.commands.output.datetime", Mock(now=lambda _: datetime(2031, 1, 1, tzinfo=UTC))
    )
    impact = command("publish", version.id, "--from", "now", "--reason", "r", "--dry-run", "--json").json
    assert abs(datetime.fromisoformat(impact["at"]) - datetime.now(UTC)) < timedelta(minutes=1)
    assert command("k", "0K1XE8", "--iso", 3200, "--at", "now").code == Exit.DONE


def test_a_rig_is_registered_and_named_again(command, calibrated):
    client = calibrated[0].client
    other = client.create_camera("DJI", "FC6520", "second head")
    ended = command("rig", "head", "--camera", "0K1XE8", "--camera", other.id, "--json")
    assert (ended.json["sets"], ended.json["stability"]) == ([], [])
    assert client.find_rig("head").camera_ids[1] == other.id
    assert "none" in command("rig", "head").out
    missing = command("rig", "wing")
    assert (missing.code, "Registered: head." in missing.err) == (Exit.NOT_FOUND, True)


def test_the_table_of_a_rig():
    number = {"value": 11.2345, "standard_uncertainty": 0.012, "unit": "deg"}
    pose = {"camera": "R1", **dict.fromkeys(("yaw", "pitch", "roll", "x", "y", "z"), number)}
    flag = {"flag": "few_triggers", "where": "camera R1", "detail": "Triggers: 3."}
    answer = {
        "sets": [{"orientation": {"poses": [pose], "flags": [flag]}}],
        "stability": [
            {"camera": "R1", "name": name, "verdict": "cannot_tell"}
            for name in ("yaw", "pitch", "roll", "x", "y", "z")
        ],
        "left_out": [{"calibration_id": "cal_1", "why": "No triggers."}],
    }
    assert list_reasons(answer) == ["few_triggers: camera R1 Triggers: 3.", "cal_1: No triggers."]
    columns = show_rig(answer).columns
    assert next(iter(columns[2].cells)).plain == "11.235 ± 0.012 deg"
    assert next(iter(columns[3].cells)).plain == "cannot tell"


def test_every_command_shows_an_example_and_the_first_page_where_to_begin(stilb_command):
    """A list of commands by section; each command's own help ends with an example that names it."""

    def leaves(group, path=()):
        for name, member in group.commands.items():
            yield from leaves(member, (*path, name)) if hasattr(member, "commands") else [(*path, name)]

    first = " ".join(stilb_command().err.split())
    assert "From the card to coefficients in force: login" in first
    assert "First steps: stilb login URL, then stilb campaign init FOLDER" in first
    for path in leaves(typer.main.get_command(app)):
        assert path[0] in first
        shown = " ".join(stilb_command(*path, "--help").out.split())
        assert f"Example: stilb {' '.join(path)}" in shown, path


@pytest.fixture
def complete(stilb_command, monkeypatch):

    def complete(*words):
        monkeypatch.setenv("_STILB_COMPLETE", "complete_bash")
        monkeypatch.setenv("COMP_WORDS", " ".join(("stilb", *words)))
        monkeypatch.setenv("COMP_CWORD", str(len(words)))
        told = set(stilb_command().out.split("\n")) - {""}
        monkeypatch.delenv("_STILB_COMPLETE")
        return told

    return complete


def test_names_of_the_client_are_completed_without_a_service(complete):
    assert complete("push", ".", "--role", "") >= {"light", "dark", "field"}
    assert complete("calibrate", "P", "--model", "p") == {"proportional", "power"}
    assert complete("k", "c", "--method", "g") == {"geometry"}
    assert complete("campaign", "show", "") == set()


def test_campaigns_and_cameras_are_those_of_the_service(signed_in, team, complete):
    assert signed_in("whoami").code == 0
    campaign = team.campaign()
    team.client.change_campaign(campaign.id, project_number="Ring-Road")
    assert complete("campaign", "show", "Ri") == {"Ring-Road"}
    assert complete("k", "") == {team.client.camera(campaign.camera_id).serial}


def test_road_is_planned_read_evaluated_and_saved(command, calibrated, tmp_path):
    team, campaign, *_ = calibrated
    frame = team.client.push(campaign.id, write_road_frame(tmp_path), role="field")
    team.client.wait(frame.job_id)
    frames = [{"frame_id": frame.id, "marks": MARKS}]
    stated = {"name": "Mill Road", "site": SITE, "requirement": REQUIREMENT, "frames": frames}
    (tmp_path / "road.json").write_text(json.dumps(stated))
    plan = command("road", tmp_path / "road.json", "--plan", tmp_path / "card.pdf", "--json").json
    assert len(plan["points"]) > 4
    assert (tmp_path / "card.pdf").read_bytes().startswith(b"%PDF")
    read = [(each["name"], each["x_m"], each["y_m"], each["values"][0]) for each in list_points(None)]
    lines = [f"{name},{x_m},{y_m},illuminance,lx,{value}" for name, x_m, y_m, value in read]
    table = tmp_path / "points.csv"
    table.write_text("\n".join(["name,x_m,y_m,quantity,unit,value", *lines]))
    ended = command("road", plan["road_id"], "--points", table, "--save", tmp_path / "out")
    assert ended.code == Exit.DONE, ended.err
    assert "conforms" in ended.out
    saved = sorted(path.suffix for path in (tmp_path / "out").iterdir())
    assert saved == [".csv", ".geojson", ".pdf", ".png"]
    assert [each.name for each in team.client.roads()] == ["Mill Road"]
