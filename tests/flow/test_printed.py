"""What README and docs print works, word for word, on a running service with frames above 1 MiB."""

import json
import os
import re
import shutil
import xml.etree.ElementTree as ET

import pytest

from tests.support.campaigns import ISOS, K_TRUE, LEVELS
from tests.support.fieldwork import write_field_folder
from tests.support.frames import write_frame
from tests.support.printed import NO_CURL, link_checkout, read_blocks, type_in

pytestmark = pytest.mark.skipif(shutil.which("curl") is None, reason=NO_CURL)

SHAPE = (640, 896)
SERIES = "exposure_time_s,f_number,R,G,B\n" + "".join(
    f"{time_s},{f_number},{signal},{signal + 8},{signal}\n"
    for time_s in (0.01, 0.02, 0.04)
    for f_number in (4.0, 5.6)
    for signal in [round(4e6 * time_s / f_number**2)]
)


@pytest.fixture(scope="module")
def field(installed, tmp_path_factory):
    """A checkout with the folder of docs/http.md and both wheels in it."""
    folder = tmp_path_factory.mktemp("field")
    write_field_folder(folder, isos=ISOS[:1], shape=SHAPE)
    copied = next((folder / "dark").iterdir())
    copied.rename(copied.with_name("copy of dark (1).DNG"))
    write_frame(folder / "field" / "street.DNG", signal_dn=320.0, seed=99, shape=SHAPE)
    (folder / "exposure_series.csv").write_text(SERIES)
    link_checkout(folder)
    for wheel in (installed.parent / "dist").iterdir():
        (folder / wheel.name).symlink_to(wheel)
    return folder


def test_every_command_from_a_first_calibration_to_its_recall(embedded, installed, field):
    """In one shell, as a reader goes from page to page; lines between the blocks set what a page names."""
    first, events = read_blocks("docs/http.md")
    lanes, lines = read_blocks("docs/measuring.md")
    without_checkout, version, measurement = read_blocks("docs/certificate.md")
    audit, history = read_blocks("docs/history.md")
    parts = {
        "first": first,
        "events": events,
        "series": "".join(read_blocks("docs/dashboards.md")),
        "tools": "".join(read_blocks("docs/tools.md")),
        "street": "FRAME=$(get -F file=@field/street.DNG "
        '"$STILB/v1/campaigns/$CAMPAIGN/frames?role=field" | pick \'["id"]\')',
        "lanes": lanes,
        "measured": 'MSR=$(get "$STILB/v1/measurements" | pick \'["items"][0]["id"]\'); CAL=$VERSION',
        "lines": lines,
        "verified": without_checkout + version + measurement,
        "history": history,
        "head": "HEAD=$(make audit | sed -n 's/^head //p')",
        "audit": audit,
    }
    script = "".join(f"printf '\\n-- {name}\\n'\n{block}\n" for name, block in parts.items())
    with embedded.team() as team:
        address = {"STILB": team.url, "KEY": team.key, "STILB_URL": team.url, "STILB_KEY": team.key}
        more = address | {"STILB_DATA": str(embedded.data), "COLUMNS": "200"}
        told = type_in(field, script, first=installed / "bin", **more)
    said = dict(re.findall(r"^-- (\w+)\n(.*?)\n*(?=^-- |\Z)", told, re.MULTILINE | re.DOTALL))

    states = re.findall(r"^\w+$", said["first"], re.MULTILINE)
    assert states == ["succeeded"] * len([*field.glob("level-*/*"), *field.glob("dark/*")])
    in_force = json.loads(said["first"][said["first"].rindex('{"items":') :])["items"]
    found = {item["iso"]: item for item in in_force if item["name"] == "luminance_k"}
    assert list(found) == [ISOS[0]]
    for item in found.values():
        assert abs(item["value"] - K_TRUE) <= 3 * item["standard_uncertainty"]
    assert len((field / "points.csv").read_text().splitlines()) > len(LEVELS)
    assert ET.parse(field / "plot.svg").getroot().tag.endswith("svg")

    assert "succeeded" in said["events"]
    assert (field / "coefficients.csv").stat().st_size
    assert sorted(json.loads(said["tools"].splitlines()[-1])["exponents"]) == ["exposure_time_s", "f_number"]
    assert {path.suffix for path in (field / "maps").iterdir()} >= {".tif"}
    assert {path.suffix for path in (field / "results").iterdir()} == {".geojson"}
    assert said["verified"].count("the same to the last bit") == 5
    assert (field / "home" / "certificate.pdf").read_bytes().startswith(b"%PDF")
    check_history(said["history"])
    assert said["audit"].count("the audit trail is whole: ") == 2


def check_history(said):
    still_open, ticked, impact, published, measurements, version, recall, confirmed, entries = (
        said.splitlines()
    )
    assert int(still_open) > int(json.loads(ticked)["open"])
    assert json.loads(impact)["against"]["version"] == 1
    assert json.loads(published)["state"] == "published"
    assert (measurements, version, confirmed) == ("[]", "2", "confirmed")
    assert [v["state"] for v in json.loads(recall)["versions"]] == ["superseded", "revoked"]
    assert {"calibration.create"} <= {entry["action"] for entry in json.loads(entries)["items"]}


def test_every_command_from_the_card_to_what_is_in_force(embedded, installed, field, tmp_path):
    completed, card = read_blocks("docs/command-line.md")
    shutil.copytree(field / "field", tmp_path / "card" / "field", copy_function=os.link)
    for place in (*field.glob("level-*"), field / "dark"):
        shutil.copytree(place, tmp_path / "card" / place.name, copy_function=os.link)
    shutil.copy(field / "readings.csv", tmp_path / "card")
    with embedded.team() as team:
        address = {"STILB": team.url, "KEY": team.key}
        told = type_in(tmp_path, completed.splitlines()[1] + "\n" + card, first=installed / "bin", **address)
    assert "completion installed" in told
    assert "16 of 16 received, 0 pass" not in told
    assert "version 1 is in force from 2026-05-01T00:00:00Z on" in told
    assert "street.DNG" in told
    assert (tmp_path / "out" / "certificate.json").exists()
