"""The commands of README and of the page on HTTP work, word for word, on a running service."""

import json
import os
import re
import shutil
import subprocess
import xml.etree.ElementTree as ET

import pytest

from tests.support.campaigns import ISOS, K_TRUE, LEVELS
from tests.support.compose import ROOT
from tests.support.fieldwork import write_field_folder

README = (ROOT / "README.md").read_text(encoding="utf-8")
HTTP_PAGE = (ROOT / "docs" / "http.md").read_text(encoding="utf-8")
LINES = re.compile(r"^    (curl .*[^\\\n])$", re.MULTILINE)
PAGES = (ROOT / "docs" / "pages.md").read_text(encoding="utf-8")


@pytest.mark.skipif(shutil.which("curl") is None, reason="the commands are curl's")
def test_every_command_of_the_first_calibration_is_true(embedded, tmp_path):
    blocks = re.findall(r"^```sh\n(.*?)^```", HTTP_PAGE, re.MULTILINE | re.DOTALL)
    assert len(blocks) == 1
    field = tmp_path / "field"
    write_field_folder(field)
    copied = next((field / "dark").iterdir())
    copied.rename(copied.with_name("copy of dark (1).DNG"))
    with embedded.team() as team:
        environment = os.environ | {"STILB": team.url, "KEY": team.key}
        done = subprocess.run(
            ["sh", "-euc", blocks[0]],
            check=False,
            cwd=field,
            env=environment,
            capture_output=True,
            text=True,
        )
        (campaign,) = team.client.campaigns()
        environment |= {"URL": team.url, "CAMERA": campaign.camera_id, "CAMPAIGN": campaign.id}
        for page, count in (("dashboards.md", 5), ("tools.md", 1)):
            lines = LINES.findall((ROOT / "docs" / page).read_text(encoding="utf-8"))
            assert len(lines) == count
            for line in lines:
                asked = line.replace("curl", "curl -sS --fail-with-body", 1)
                subprocess.run(["sh", "-euc", asked], check=True, cwd=field, env=environment)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    assert done.stderr == ""
    states = re.findall(r"^\w+$", done.stdout, re.MULTILINE)
    frames = list(field.rglob("*.DNG"))
    assert states == ["succeeded"] * len(frames)
    in_force = json.loads(done.stdout[done.stdout.rindex('{"items":') :])["items"]
    found = {item["iso"]: item for item in in_force if item["name"] == "luminance_k"}
    assert sorted(found) == list(ISOS)
    for item in found.values():
        assert abs(item["value"] - K_TRUE) <= 3 * item["standard_uncertainty"]
    assert len((field / "points.csv").read_text().splitlines()) > len(ISOS) * len(LEVELS)
    assert ET.parse(field / "plot.svg").getroot().tag.endswith("svg")


def test_pictures_exist_and_are_small():
    for page, folder in ((README, ROOT), (PAGES, ROOT / "docs")):
        names = re.findall(r"!\[[^]]+\]\(([^)]+)\)", page)
        assert names
        for name in names:
            assert (folder / name).stat().st_size < 100_000
            assert (folder / name).read_bytes()[8:12] == b"WEBP"
