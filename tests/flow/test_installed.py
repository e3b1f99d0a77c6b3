"""`stilb-server` from its wheel. The other flow tests calibrate with it; these are about what it holds."""

import email
import json
import os
import re
import subprocess
import zipfile

import httpx

from store.software import list_revisions, read_version
from tests.support.compose import ROOT, load_script

ROOMS = load_script("server_wheel").ROOMS


def run(installed, *command, **environment):
    """Run a command of it where the checkout's rooms would be found first."""
    return subprocess.run(
        [installed / "bin" / command[0], *command[1:]],
        check=False,
        cwd=ROOT,
        env=os.environ | environment,
        capture_output=True,
        text=True,
    )


def test_release_accepts_the_wheel(server_wheel):
    release, version = load_script("release"), read_version()
    listed = subprocess.run(["git", "ls-files", *ROOMS], cwd=ROOT, check=True, capture_output=True, text=True)
    manual = [str(each.relative_to(ROOT / "docs")) for each in load_script("server_wheel").list_pages(ROOT)]
    committed = [*listed.stdout.splitlines(), *(f"service/pages/manual/{each}" for each in manual)]
    found = release.inspect_wheel(
        server_wheel, name="stilb-server", version=version, rooms=ROOMS, committed=committed
    )
    assert found.right, found
    with zipfile.ZipFile(server_wheel) as archive:
        names = archive.namelist()
        (path,) = [name for name in names if name.endswith("/METADATA")]
        stated = email.message_from_bytes(archive.read(path))
    assert "authors" in stated["Author"]
    assert not re.search(r"\]\((?!https?:)", stated.get_payload())
    assert {f"{room}/py.typed" for room in ROOMS} <= {*names}
    bill = json.loads((server_wheel.parent / f"stilb_server-{version}.cdx.json").read_text())
    pins = re.findall("^([a-z0-9.-]+).*==", (ROOT / "requirements.lock").read_text(), re.MULTILINE)
    assert [each["name"] for each in bill["components"]] == pins
    assert all(each["properties"] for each in bill["components"])
    assert sum(each.startswith("migrations/versions/0") for each in committed) == len(list_revisions())


def test_the_command_runs_the_installed_rooms_from_any_folder(installed, tmp_path):
    assert run(installed, "stilb-server", "--version").stdout == f"stilb-server {read_version()}\n"
    data = tmp_path / "data"
    key = run(installed, "stilb-server", "key", STILB_DATA=str(data))
    assert (key.stdout, key.stderr) == ((data / "key").read_text(), "")
    where = "import service.up as a, store.software as b; print(a.__file__, b.MIGRATIONS)"
    found = run(installed, "python", "-c", where, PYTHONSAFEPATH="1").stdout.split()
    assert len(found) == 2
    assert all(each.startswith(str(installed)) for each in found)


def test_an_unknown_command_lists_those_that_exist(installed):
    refused = run(installed, "stilb-server", "start")
    assert (refused.returncode, refused.stdout) == (2, "")
    assert "'migrate'" in refused.stderr


def test_an_installed_server_has_what_lies_beside_its_code(embedded):
    with httpx.Client(base_url=embedded.url, timeout=60, follow_redirects=True) as http:
        page = http.get("/docs/errors")
        assert "stored_file_damaged" in page.text
        sheets = re.findall(r'href="(/static/[^"]+\.css)"', page.text)
        assert {http.get(path).status_code for path in [*sheets, "/docs", "/openapi.json"]} == {200}
        assert sheets
