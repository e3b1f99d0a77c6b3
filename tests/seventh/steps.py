"""The road of a seventh method from page and card to certificate; run in a tree that has the method."""

import json
import os
import subprocess
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

from tests.support.browser import CHROMIUM, launch, settle, sign_in, visit
from tests.support.deployments import Embedded, short_folder
from tests.support.frames import write_frame
from tests.support.house import CAMERA

SIGNALS = (1000.0, 1010.0, 990.0)
BLACK = 256.0


def stilb(team, *words):
    environment = os.environ | {
        "STILB_URL": team.url,
        "STILB_KEY": team.key,
        "HOME": os.environ["SEVENTH_HOME"],
    }
    command = [sys.executable, "-m", "stilb", *map(str, words)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{words}: {done.stdout}{done.stderr}"
    return done.stdout


def fill_in(card: Path) -> None:
    flat = card / "flat"
    flat.mkdir(parents=True)
    for index, signal in enumerate(SIGNALS):
        write_frame(flat / f"flat-{index}.DNG", signal_dn=signal, seed=index)


def calibrate_by_command(team, card):
    names = [word for name in ("make", "model", "serial") for word in (f"--{name}", CAMERA[name])]
    stilb(team, "campaign", "init", card, "--method", "brightness", *names)
    path = card / "campaign.toml"
    text = path.read_text()
    assert "# Offset [DN]: Signal that is subtracted from every mean." in text
    text = text.replace("# offset_dn = 0.0", f"offset_dn = {BLACK}")
    polygon = "[region]\npolygon = [[0, 0], [96, 0], [96, 64], [0, 64]]\n"
    path.write_text(text.replace("# [region]\n", polygon, 1))
    said = json.loads(stilb(team, "campaign", "run", card, "--json"))
    (version,) = team.client.calibrations(said["campaign_id"])
    return version


def check_answers(team, version) -> None:
    http = team.http()
    (listed,) = [each for each in http.get("/v1/methods").json()["items"] if each["name"] == "brightness"]
    assert listed["roles"][0]["name"] == "flat"
    rows = http.get(
        f"/v1/cameras/{version['camera_id']}/coefficients", params={"method": "brightness"}
    ).json()["items"]
    assert [(row["name"], row["unit"], row["iso"]) for row in rows] == [("brightness_dn", "DN", 3200.0)]
    assert abs(rows[0]["value"] - 1000.0) < 1.0
    address = f"/v1/calibrations/{version['id']}"
    points = http.get(f"{address}/points.csv").text.splitlines()
    assert len(points) == 1 + len(SIGNALS)
    assert "signal_dn" in points[0]
    assert "Brightness calibration" in http.get(f"{address}/plot.svg").text
    assert http.get(f"{address}/certificate.pdf").content.startswith(b"%PDF-")
    certificate = http.get(f"{address}/certificate.json").json()
    assert certificate["procedure"] == "Mean raw signal of a region per ISO value"
    refused = http.post(f"/v1/campaigns/{version['campaign_id']}/calibrations", json={"tolerance": 0.04})
    assert "tolerance: is not a parameter of a brightness fit" in refused.json()["detail"]


def verify(team, version, folder: Path) -> None:
    stilb(team, "export", version["id"], folder)
    certificate = folder / "certificate.json"
    if not certificate.exists():
        certificate.write_bytes(team.http().get(f"/v1/calibrations/{version['id']}/certificate.json").content)
    command = [sys.executable, "-m", "verify", str(certificate), "--data", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def begin_by_page(url, key) -> None:
    if not Path(CHROMIUM).is_file():
        return
    with sync_playwright() as playwright:
        browser = launch(playwright)
        with visit(browser, url) as context:
            page = sign_in(context, key)
            page.goto("/campaigns/new")
            settle(page)
            page.get_by_role("radio", name="Brightness").check()
            page.get_by_role("button", name="Create campaign").click()
            page.wait_for_url("**/campaigns/cmp_*")
            settle(page)
            page.get_by_text("Parameters of the fit").click()
            assert page.get_by_label("Offset").is_visible()
        browser.close()


def main() -> None:
    with short_folder() as folder, Embedded(folder / "data") as deployment, deployment.team() as team:
        os.environ["SEVENTH_HOME"] = str(folder)
        card = folder / "card"
        fill_in(card)
        version = calibrate_by_command(team, card).raw
        team.client.publish(version["id"], valid_from="2020-01-01T00:00:00Z", reason="first")
        check_answers(team, version)
        verify(team, version, folder / "export")
        begin_by_page(deployment.url, team.key)


if __name__ == "__main__":
    main()
