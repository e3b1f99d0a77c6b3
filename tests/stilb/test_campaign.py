"""A campaign in a folder: one command goes from card to draft, and once more changes nothing."""

import re

import pytest

from stilb.commands.output import Exit
from stilb.field.files import ROLES
from stilb.field.plan import ensure_campaign, read_plan
from stilb.field.template import read_methods
from stilb.problem import Unclear
from tests.support.campaigns import K_TRUE, LEVELS
from tests.support.cards import write_card, write_plan
from tests.support.disks import filled, small_disk
from tests.support.printed import read_blocks

NUMBERS = "readings.csv"
MACRO = 'imagej = "makePolygon(8,8,88,8,88,56,8,56);"'
HALF_A_PANEL = '[panel]\nserial = "P"\nmeasured_on = 2026-03-14\n'
KINDS = {"sharpness": "siemens_star", "geometry": "checkerboard"}


@pytest.fixture
def card(tmp_path, shots):
    """What a fit needs and no more: one ISO, two settings."""
    few = [shot for shot in shots if "-3200-" in shot.path.name and not shot.path.stem.endswith("-2")]
    folder = write_card(tmp_path / "card", few)
    write_plan(folder)
    return folder


@pytest.fixture
def handful(tmp_path, shots):
    """Two frames, for what ends before a fit."""
    folder = write_card(tmp_path / "card", shots[:2])
    write_plan(folder)
    return folder


def test_from_card_to_draft_to_what_is_in_force_and_once_more_changes_nothing(signed_in, card, team):
    ended = signed_in("campaign", "run", card, "--json")
    assert ended.code == Exit.DONE, ended.err
    draft = ended.json["calibration"]
    assert (ended.json["received"], draft["state"]) == (10, "draft")
    assert draft["parameters"]["tolerance_rel"] == 0.04
    (k,) = [row for row in draft["coefficients"] if row["name"] == "luminance_k" and "f_number" not in row]
    assert abs(k["value"] - K_TRUE) <= 3 * k["standard_uncertainty"]
    meters = {reading["meter_id"] for reading in team.client.readings(ended.json["campaign_id"])}
    assert meters == {meter.id for meter in team.client.meters()}
    again = signed_in("campaign", "run", card, "--json").json
    assert (ended.json["sent"], again["sent"], again["calibration"]["id"]) == (10, 0, draft["id"])
    assert len(list(team.client.campaigns())) == 1
    assert len(list(team.client.readings(ended.json["campaign_id"]))) == 2 * len(LEVELS)
    publish = ("publish", draft["id"], "--from", "2026-05-01", "--reason", "spring")
    dry = signed_in(*publish, "--dry-run")
    assert "Nothing is in force then" in dry.out
    assert signed_in("k", "0K1XE8").code == Exit.NOT_FOUND
    assert "version 1 is in force from 2026-05-01T00:00:00Z on" in signed_in(*publish).out
    shown = signed_in("k", "0K1XE8", "--iso", 3200, "--at", "2026-06-01")
    assert f"{k['value']:.3f} ± {k['standard_uncertainty']:.3f} DN*m2/(cd*s)" in shown.out
    assert "version 1 is in force" in shown.out
    assert "published" in signed_in("history", "0K1XE8").out
    revoked = signed_in("revoke", draft["id"], "--reason", "the meter was dropped")
    assert f"{draft['id']} is revoked; measured with it: 0 measurements and 0 roads" in revoked.out
    (version,) = signed_in("history", "0K1XE8", "--json").json["items"]
    assert version["state"] == "revoked"


def test_lamp_is_a_name_or_a_file(handful):
    path = handful / "campaign.toml"
    (handful / "lamp.csv").write_text("380,1\n780,1\n")
    said = '[campaign]\nlamp = "lamp.csv"\ncamera_response = "Nikon D5100"\nfocus_distance_m = 1.5'
    path.write_text(path.read_text().replace("[campaign]", said, 1))
    plan = read_plan(handful)
    assert plan.campaign["lamp"] == "380,1\n780,1\n"
    assert plan.campaign["camera_response"] == "Nikon D5100"


def test_corrected_readings_take_the_place_of_the_others(signed_in, handful, team):
    campaign_id = signed_in("campaign", "run", handful, "--no-fit", "--json").json["campaign_id"]
    text = (handful / NUMBERS).read_text()
    (handful / NUMBERS).write_text(text.replace("luminance,39.92", "luminance,39.9"))
    kept = signed_in("campaign", "run", handful, "--no-fit")
    assert "readings 8 of those that count are not in the folder" in kept.err
    assert "--replace-readings" in kept.err
    signed_in("campaign", "run", handful, "--no-fit", "--replace-readings")
    assert 39.9 in in_use(team, campaign_id)
    (handful / NUMBERS).write_text(text)
    signed_in("campaign", "run", handful, "--no-fit", "--replace-readings")
    assert in_use(team, campaign_id) == sorted(value * f for value in LEVELS.values() for f in (0.998, 1.002))


def in_use(team, campaign_id):
    return sorted(r["value"] for r in team.client.readings(campaign_id) if "withdrawn_at" not in r)


def test_american_units_and_a_decimal_comma(signed_in, team, tmp_path):
    campaign = team.campaign()
    path = tmp_path / "lambert.csv"
    path.write_text("scene;quantity;value;unit\na;luminance;1,5;fL\n", encoding="utf-8-sig")
    ended = signed_in("campaign", "readings", campaign.id, path, "--json")
    (row,) = ended.json["items"]
    assert (row["unit"], row["entered_value"]) == ("cd/m2", 1.5)
    assert row["value"] == pytest.approx(1.5 * 3.4262590996)
    path.write_bytes("scene;Größe".encode("latin-1"))
    assert "not UTF-8" in signed_in("campaign", "readings", campaign.id, path).err


def test_results_of_imagej_are_frames(signed_in, team, tmp_path):
    path = tmp_path / "Results.csv"
    head = " ,Label,Area,Mean,Min,Max,Mode,scene,exposure_time,f_number"
    path.write_text(f"{head}\n1,a.tif,900,500.5,400,600,5,level-1,1/60,4\n")
    asked = ["campaign", "points", team.campaign().id, path, "--white-level-dn", "4095", "--json"]
    ended = signed_in(*asked, "--iso", "3200")
    assert [each["filename"] for each in ended.json["items"]] == ["a.tif"]
    assert ended.json["ignored_columns"] == ["mode"]
    assert "lacks iso" in signed_in(*asked).err


def test_a_fit_that_lacks_something_says_what(signed_in, handful):
    (handful / NUMBERS).write_text("scene,quantity,value,unit\nlevel-1,luminance,40,cd/m2\n")
    plan = (handful / "campaign.toml").read_text()
    (handful / "campaign.toml").write_text(plan.replace("[region]\nimagej", "[region]\n# imagej"))
    ended = signed_in("campaign", "run", handful, "--json")
    assert (ended.code, ended.json["error"]["code"]) == (Exit.REFUSED, "campaign_incomplete")
    assert "stilb campaign show" in ended.err
    shown = signed_in("campaign", "show", "P-17").out
    assert "missing: " in shown
    assert "2 frames" in shown


def test_a_full_disk_is_named_and_keeps_no_half_a_file_and_no_frame_waits_for_a_receipt(
    signed_in, handful, team, tmp_path
):
    (disk := tmp_path / "disk").mkdir()
    campaign = team.client.create_campaign(team.client.create_camera("DJI", "FC6520", "0K1XE8").id)
    with small_disk(disk, megabytes=1), filled(disk):
        ended = signed_in("campaign", "init", disk)
        assert ended.code == Exit.USAGE
        assert f"No space left on device: {disk}/campaign.toml\nMake room there" in ended.err
        to = ("--campaign", campaign.id, "--role", "dark", "--receipt", disk / "receipt.json")
        ended = signed_in("push", handful, *to)
        assert f"no receipt, keep the card: No space left on device: {disk}/receipt.json" in ended.err
        assert "2 of 2 received" in ended.out
        assert [path.name for path in disk.iterdir()] == ["filler"]


def test_init_writes_what_run_reads_once_it_is_filled_in(signed_in, handful):
    (handful / "campaign.toml").unlink()
    for frame in handful.rglob("*.DNG"):
        frame.rename(frame.with_suffix(".keep"))
    ended = signed_in("campaign", "init", handful, "--make", "DJI", "--model", 'FC"6520')
    assert f"stilb campaign run {handful}" in ended.out
    unfilled = signed_in("campaign", "run", handful)
    assert unfilled.code == Exit.USAGE
    assert "serial in camera is not filled in" in unfilled.err
    text = (handful / "campaign.toml").read_text()
    (handful / "campaign.toml").write_text(text.replace('serial = ""', 'serial = "0K1XE8"', 1))
    plan = read_plan(handful)
    assert (plan.model, plan.serial, plan.project_number) == ('FC"6520', "0K1XE8", "card")
    assert plan.fit == {}  # the defaults, until a line is uncommented
    assert plan.readings_csv == (handful / NUMBERS).read_text()
    (handful / "campaign.toml").unlink()
    signed_in("campaign", "init", handful, "--night", "--lamp", "led", "--mains", "0", "--serial", "0K1XE8",
              "--make", "DJI", "--model", "M")  # fmt: skip
    night = read_plan(handful).campaign
    assert (night["lamp_kind"], night["mains_frequency_hz"]) == ("led", 0)
    (handful / "campaign.toml").write_text(text.replace('serial = ""', 'serial = "0K1XE8"', 1))
    again = signed_in("campaign", "init", handful)
    assert (again.code, read_plan(handful)) == (Exit.USAGE, plan)
    # what the files state is not asked for
    (handful / "campaign.toml").unlink()
    for frame in handful.rglob("*.keep"):
        frame.rename(frame.with_suffix(".DNG"))
    signed_in("campaign", "init", handful)
    plan = read_plan(handful)
    assert (plan.make, plan.model, plan.serial) == ("DJI", "FC6520", "0K1XE8")


@pytest.mark.parametrize("method", read_methods())
def test_everything_that_is_commented_out_in_a_template_can_be_used(signed_in, team, tmp_path, method):
    signed_in(
        *("campaign", "init", tmp_path, "--method", method), *("--make", "M", "--model", "M", "--serial", "S")
    )
    path = tmp_path / "campaign.toml"
    path.write_text(re.sub(r"^# (?=\[|[\w-]+ = )", "", path.read_text(), flags=re.MULTILINE))
    (tmp_path / NUMBERS).write_text("scene,quantity,value,unit\na,luminance,1,cd/m2\n")
    plan = read_plan(tmp_path)
    assert plan.campaign["started_at"] == "2026-05-01T20:30:00+00:00"
    campaign = ensure_campaign(team.client, plan)
    assert campaign.method == method
    assert team.client.roi(campaign.id)["polygon"]
    assert len(plan.meters) == (method == "luminance")
    assert ("panel_id" in campaign.raw) == (method == "reflectance")
    assert campaign.raw.get("target", {}).get("kind") == KINDS.get(method)
    assert {rule.role for rule in plan.rules} <= set(ROLES)


def test_a_plan_that_is_not_there_and_a_method_that_is_not_known_are_named(signed_in, tmp_path):
    ended = signed_in("campaign", "run", tmp_path)
    assert (ended.code, f"stilb campaign init {tmp_path}" in ended.err) == (Exit.USAGE, True)
    ended = signed_in("campaign", "init", tmp_path, "--method", "colour")
    assert (ended.code, (tmp_path / "campaign.toml").exists()) == (Exit.USAGE, False)
    assert "luminance, reflectance" in " ".join(ended.err.split())


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('serial = "0K1XE8"', "", "serial in camera is not filled in"),
        ("[camera]", "[kamera]", "'kamera' is unknown; allowed are camera, campaign"),
        ("[fit]", "[[fit]]", "fit must be written as [fit]"),
        ("[[meter]]", "[meter]", "meter must be written as [[meter]]"),
        ('kind = "luminance"', 'art = "x"', "'art' in meter 1 is unknown"),
        ('number = "1"', "nummer = 1", "'nummer' in the certificate of meter 1 is unknown"),
        ('role = "dark"', 'role = "black"', "role 'black' in frames is unknown; use one of light, dark"),
        ('pattern = "dark/*"\n', "", "frames with the role dark need a pattern, or first and last"),
        ("[fit]", "[fit", "at line"),
        ("[campaign]", "[campaign]\nstarted_at = 2026-05-01T20:00:00", "has no time zone"),
        ("imagej =", "polygon = [[1, 2]]\nimagej =", "region needs exactly one of polygon, imagej, file"),
        (MACRO, "polygon = [[1], [2]]", "must be three corners or more"),
        (MACRO, "parts = [[1, 2]]", "as [region.parts]"),
        (MACRO, 'file = "frames.roi"', "contains no macro"),
        ("[fit]", f"{HALF_A_PANEL}[fit]", "bands in panel is not filled in"),
        ('file = "readings.csv"', 'file = "no.csv"', "put the file there"),
    ],
)
def test_a_plan_that_is_wrong_says_where(handful, old, new, message):
    path = handful / "campaign.toml"
    (handful / "frames.roi").write_bytes(b"Iout\x00\xe4\x00\x00")
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises((Unclear, OSError)) as found:
        read_plan(handful)
    assert message in str(found.value)


def test_the_table_that_the_page_prints_names_these_files(handful):
    (printed,) = read_blocks("docs/command-line.md", "toml")
    with (handful / "campaign.toml").open("a") as file:
        file.write(printed)
    rule = read_plan(handful).rules[-1]
    assert (rule.role, rule.scene) == ("light", "level-1")
    assert [rule.match(f"100/DJI_00{number}.DNG") for number in ("12", "13")] == [{}, None]


def test_another_word_in_the_plan_makes_no_other_campaign(signed_in, handful, team):
    first = signed_in("campaign", "run", handful, "--no-fit", "--json").json
    plan = (handful / "campaign.toml").read_text()
    (handful / "campaign.toml").write_text(plan.replace("[campaign]", '[campaign]\nrecorder = "A. Meier"'))
    again = signed_in("campaign", "run", handful, "--no-fit", "--json").json
    assert (again["campaign_id"], again["sent"]) == (first["campaign_id"], 0)
    (campaign,) = team.client.campaigns()
    assert campaign.raw["recorder"] == "A. Meier"
    named = team.client.create_campaign(campaign.camera_id, project_number="P-17 [x]")
    listed = signed_in("campaign", "list").out
    assert all(said in listed for said in ("DJI FC6520 0K1XE8", named.id, "P-17 [x]"))


def test_a_run_that_was_killed_before_its_answer_makes_one_campaign(handful, team, monkeypatch):
    """Neither of the two has seen what the other made."""
    monkeypatch.setattr("stilb.field.plan.find_planned", lambda *_: None)
    plan = read_plan(handful)
    assert ensure_campaign(team.client, plan).id == ensure_campaign(team.client, plan).id
