"""A panel capture in a folder: one command goes from card to one K a band."""

import numpy as np
import pytest

import stilb
from simulation.camera import change
from simulation.multispectral_files import name_file, write_sequoia
from simulation.sequoia import BANDS, SEQUOIA, capture
from stilb.commands.calibration import format_calibration
from stilb.commands.output import Exit
from stilb.field.plan import ensure_campaign, ensure_panel, list_parameters, read_plan
from stilb.problem import Problem, Unclear

REFLECTS = 0.18
BANDS_TOML = ", ".join(
    f'{{ band = "{band}", reflectance = {REFLECTS}, standard_uncertainty = 0.002 }}' for band in BANDS
)
PLAN = """
[camera]
make = "Parrot"
model = "Sequoia"
serial = "{serial}"

[campaign]
method = "reflectance"
project_number = "field 7"

[panel]
serial = "P-18"
measured_on = 2018-03-01
bands = [{bands}]

[region]
polygon = [[50, 40], [110, 40], [110, 80], [50, 80]]
"""


@pytest.fixture
def card(tmp_path):
    camera = change(SEQUOIA, height_px=120, width_px=160)
    shots = capture(camera, np.random.default_rng(1), reflectance=dict.fromkeys(BANDS, REFLECTS))
    (tmp_path / "panel").mkdir()
    for shot in shots.values():
        write_sequoia(tmp_path / "panel" / name_file(0, shot.header), shot)
        serial = shot.header.serial
    (tmp_path / "campaign.toml").write_text(PLAN.format(serial=serial, bands=BANDS_TOML))
    return tmp_path


def test_from_card_to_one_k_a_band_in_force(signed_in, card):
    ended = signed_in("campaign", "run", card, "--json")
    assert ended.code == Exit.DONE, ended.err
    draft = ended.json["calibration"]
    found = {row["band"]: row for row in draft["coefficients"]}
    assert found.keys() == BANDS.keys()
    for band, row in found.items():
        assert abs(row["value"] - BANDS[band].reflectance_k) < 4 * row["standard_uncertainty"]
    *_, suggested = format_calibration(stilb.Calibration.of(draft))
    assert suggested.startswith(
        f"Put it in force: stilb publish {draft['id']} --from 2018-04-13 --to 2018-04-14 "
    )
    signed_in("publish", draft["id"], "--from", "2018-01-01", "--reason", "spring")
    shown = signed_in("k", draft["camera_id"], "--method", "reflectance", "--at", "2018-05-01")
    assert shown.code == Exit.DONE, shown.err
    assert all(band in shown.out for band in BANDS)


def test_files_of_another_method_than_the_default_are_told_before_they_are_sent(signed_in, card):
    (card / "campaign.toml").unlink()
    assert signed_in("campaign", "init", card, "--method", "luminance").code == Exit.DONE
    told = "these files look like a reflectance campaign, and campaign.toml states luminance"
    assert told in " ".join(signed_in("campaign", "run", card, "--no-fit").err.split())
    assert told not in " ".join(signed_in("campaign", "run", card, "--no-fit").err.split())


def test_init_takes_the_method_that_the_service_proposes_and_tells_which(signed_in, card):
    for path in card.glob("campaign.toml"):
        path.unlink()
    ended = signed_in("campaign", "init", card)
    assert "method reflectance, as the files suggest; for another: --method" in " ".join(ended.err.split())
    assert read_plan(card).method == "reflectance"
    signed_in("logout")
    (card / "campaign.toml").unlink()
    ended = signed_in("campaign", "init", card)
    assert (ended.code, read_plan(card).method) == (Exit.DONE, "luminance")
    said = "method luminance, which is assumed (No login is stored. Sign in first: stilb login URL); for "
    assert said in " ".join(ended.err.split())


def test_a_corrected_panel_takes_the_place_of_the_other(card, team):
    first = ensure_campaign(team.client, read_plan(card))
    same = ensure_campaign(team.client, read_plan(card))
    assert (same.id, same.raw["panel_id"]) == (first.id, first.raw["panel_id"])
    path = card / "campaign.toml"
    path.write_text(path.read_text().replace("2018-03-01", "2018-03-02"))
    other = ensure_campaign(team.client, read_plan(card))
    assert other.id == first.id
    assert other.raw["panel_id"] != first.raw["panel_id"]


def write_panels(card, text):
    path = card / "campaign.toml"
    head, _, rest = path.read_text().partition("[panel]")
    path.write_text(head + text + "\n[region]" + rest.partition("[region]")[2])


def test_a_panel_measured_twice_is_used_by_the_day_and_one_alone_as_it_is(card, team):
    day = 'measured_on = {}\nbands = [{{ band = "green", reflectance = 0.18 }}]\n'
    alone = read_plan(card)
    assert list_parameters(alone) == {"panel_measured_on": "2018-03-01"}
    write_panels(
        card,
        "".join('[[panel]]\nserial = "P-19"\n' + day.format(each) for each in ("2017-01-01", "2019-01-01")),
    )
    plan = read_plan(card)
    assert (len(plan.panels), list_parameters(plan)) == (2, {})
    campaign = ensure_campaign(team.client, plan)
    assert team.client.panel(campaign.raw["panel_id"]).measured_on == "2019-01-01"


def test_a_serial_alone_names_a_registered_panel(card, team, signed_in):
    write_panels(card, '[panel]\nserial = "P-20"\n')
    plan = read_plan(card)
    campaign = ensure_campaign(team.client, plan)
    bands = [{"band": "green", "reflectance": 0.18}]
    with pytest.raises(Problem, match="is not registered"):
        ensure_panel(team.client, plan, campaign.id)
    panel = team.client.create_panel("P-20", measured_on="2018-01-01", bands=bands)
    ensure_panel(team.client, plan, campaign.id)
    assert team.client.campaign(campaign.id).raw["panel_id"] == panel.id
    ended = signed_in("campaign", "panel", campaign.id, "--serial", "P-20")
    assert (ended.code, "measured" in ended.out) == (Exit.DONE, True), ended.err
    assert signed_in("campaign", "panel", campaign.id).code == Exit.USAGE


def test_a_target_is_said_anew_only_when_it_has_changed(card, team, monkeypatch):
    path = card / "campaign.toml"
    said = path.read_text().split("[panel]")[0].replace("reflectance", "geometry")
    said += '[target]\nkind = "checkerboard"\ncolumns = 9\nrows = 6\nsquare_size_mm = 25.0\n'
    path.write_text(said)
    campaign = ensure_campaign(team.client, read_plan(card))
    change = type(team.client).change_campaign
    monkeypatch.setattr(type(team.client), "change_campaign", None)
    assert ensure_campaign(team.client, read_plan(card)).id == campaign.id
    monkeypatch.setattr(type(team.client), "change_campaign", change)
    path.write_text(said.replace("25.0", "30.0"))
    assert ensure_campaign(team.client, read_plan(card)).raw["target"]["square_size_mm"] == 30.0


def test_parts_of_a_region_have_names(card, team):
    path = card / "campaign.toml"
    said = path.read_text().split("[panel]")[0].replace("reflectance", "sharpness")
    path.write_text(
        said
        + "[region.parts]\ncentre = [[40, 40], [80, 40], [80, 80]]\n'top left' = [[1, 1], [9, 1], [9, 9]]\n"
    )
    campaign = ensure_campaign(team.client, read_plan(card))
    assert [part["name"] for part in team.client.roi(campaign.id)["regions"]] == ["centre", "top left"]
    path.write_text(path.read_text().replace("[1, 1]", "[1]"))
    with pytest.raises(Unclear, match="top left in region must be three corners or more"):
        read_plan(card)
