"""Programs that others use read back what a running service writes; docs/consumers.md has the deviations.

`WRITE=1 make consumers` writes them there.
"""

import json
import os
import re
import subprocess
import sys
from math import ceil, isnan, log10
from pathlib import Path

import httpx
import numpy as np
import pytest
import tifffile
from rich.console import Console

from demo import geometry, reflectance
from demo.journey import Display, Stage
from tests.flow.test_generated_clients import install
from tests.support import data
from tests.support.certificates import METER, WORK
from tests.support.compose import ROOT
from tests.support.fieldwork import new_team

FOLDER = Path(__file__).parent / "consumers"
PAGE = ROOT / "docs" / "consumers.md"
REAL = data.FOLDER / "p4m" / "DJI_0015.TIF"
BOARDS = (ROOT / "docs" / "dashboards.md").read_text(encoding="utf-8")
PARTS = ("geometry", "maps", "certificates", "series")


def fetch(team, path, target, **options):
    answer = httpx.get(
        f"{team.url}{path}", headers={"Authorization": f"Bearer {team.key}"}, timeout=120, **options
    )
    assert answer.status_code == 200, (path, answer.text[:500])
    target.write_bytes(answer.content)


def save_exports(team, version, folder, *names, **query):
    for name in names:
        fetch(team, f"/v1/calibrations/{version}/exports/{name}", folder / name, params=query)


@pytest.fixture(scope="module")
def saved(embedded, shots, tmp_path_factory):
    """The files of a geometry, a luminance and a reflectance version, as a user saves them."""
    folder = tmp_path_factory.mktemp("saved")
    with new_team(embedded.url, embedded.key) as team:
        client = team.client
        stage = Stage(client=client, folder=folder / "frames", display=Display(Console()), quick=True)
        for demo in (geometry, reflectance):
            assert demo.run(stage), demo.__name__
        (campaign, *_) = client.campaigns(method="geometry")
        # fx and fy that differ, which not every program can say
        uneven = client.calibrate(campaign.id, fix_aspect_ratio=False)
        plain = ("opencv.yaml", "cameras.json", "camera.json")
        save_exports(team, uneven.id, folder, *plain)
        save_luminance(team, embedded, shots, folder)
        (measured,) = [each for each in client.measurements() if "map_tif" in str(each.raw.get("links"))][:1]
        save_map(client, measured, folder / "map.tif")
        if REAL.is_file():
            save_map(client, measure_placed(client), folder / "placed.tif")
        fetch(team, "/v1/series/coefficients", folder / "coefficients.json")
        fetch(team, "/v1/series/coefficients?format=csv", folder / "coefficients.csv")
    (folder / "page.py").write_text("\n".join(re.findall(r"(?ms)^```python\n(.*?)^```", BOARDS)))
    return folder


def save_map(client, measured, path):
    client.save_map(measured.id, path)
    np.save(path.with_suffix(".npy"), tifffile.imread(path))
    client.save_stac(measured.id, path)


def measure_placed(client):
    """A panel of a real camera, whose file states how it stood, measured by itself."""
    camera = client.create_camera("DJI", "FC6360", "43e53d2eaaae3536b0fd1499da1d4389")
    band = {"band": "nir", "reflectance": 0.5, "standard_uncertainty": 0.01}
    panel = client.create_panel("P-50", measured_on="2020-06-01", bands=[band])
    campaign = client.create_campaign(camera.id, method="reflectance", panel_id=panel.id)
    client.set_roi(campaign.id, polygon=[(650, 500), (950, 500), (950, 800), (650, 800)])
    frame = client.push(campaign.id, REAL, role="panel")
    client.wait_for(campaign.id)
    version = client.calibrate(campaign.id)
    height = {"ground_altitude_m": 143.26, "height_u_m": 2.0}
    return client.measure(frame.id, calibration_id=version.id, with_bands=True, **height)


def save_luminance(team, deployment, shots, folder):
    """A version whose certificate has all that a DCC must have."""
    client = team.client
    campaign = team.campaign()
    meter = {name: METER[name] for name in ("kind", "make", "model", "serial", "certificate")}
    client.create_meter(**meter)
    with team.http() as http:
        answer = http.patch(f"/v1/campaigns/{campaign.id}", json=WORK)
        assert answer.status_code == 200, answer.text
        http.patch("/v1/organisation", json={"address": "Main Street 1"})
    frames = team.push(campaign, shots)
    deployment.wait_for_jobs([frame.id for frame in frames])
    version = client.calibrate(campaign.id)
    client.publish(version.id, valid_from="2026-01-01T00:00:00Z", reason="spring")
    path = f"/v1/calibrations/{version.id}"
    fetch(team, f"{path}/certificate.xml", folder / "certificate.xml", params={"country": "DE"})
    for name in ("certificate.json", "certificate.pdf"):
        fetch(team, f"{path}/{name}", folder / name)


@pytest.fixture(scope="module")
def python():
    lock = FOLDER / "requirements.lock"
    uv = str(Path(sys.executable).with_name("uv"))
    into = ["--require-hashes", "--no-deps", "--python", "tools", "-r", lock.name]
    folder = install(
        lock, [uv, "venv", "-q", "--python", sys.executable, "tools"], [uv, "pip", "install", "-q", *into]
    )
    return folder / "tools" / "bin" / "python"


@pytest.mark.timeout(900)
def test_programs_read_back_what_the_service_writes(saved, python):
    rows = []
    for part in PARTS:
        done = subprocess.run(
            [python, FOLDER / "read.py", part, saved],
            check=False,
            capture_output=True,
            text=True,
            cwd=saved,
            env=os.environ | {"MPLCONFIGDIR": str(saved), "PYTHONPATH": ""},
            timeout=250,
        )
        assert done.returncode == 0, f"{part}\n{done.stdout[-2000:]}{done.stderr[-4000:]}"
        rows += json.loads(done.stdout.splitlines()[-1])
    found = render(rows)
    page = PAGE.read_text(encoding="utf-8")
    before, table, after = re.split(r"(?s)(?<=<!-- read -->\n)(.*?)(?=\n<!-- end -->)", page)
    if os.environ.get("WRITE"):
        PAGE.write_text(before + found + after, encoding="utf-8")
    else:
        unread = [line for line in found.splitlines() if line.endswith("| not read |")]
        assert set(found.splitlines()) - set(unread) <= set(table.splitlines())


def render(rows):
    lines = ["| program | file | compared | largest deviation |", "|---|---|---|---|"]
    for program, file, compared, deviation, unit in rows:
        largest = bound(deviation, unit) if unit else f"{deviation:g}"
        shown = "not read" if isnan(deviation) else largest
        lines.append(f"| {program} | `{file}` | {compared} | {shown} |")
    return "\n".join(lines)


def bound(deviation, unit):
    """The next power of ten, 1e-9 at least: the last bits differ from processor to processor."""
    return f"below {10.0 ** ceil(log10(max(2 * deviation, 1e-9))):g} {unit}"
