"""The commands of the page on history work, word for word, after those of the page on HTTP."""

import json
import os
import re
import shutil
import subprocess
import sys

import pytest

from tests.flow.test_readme import HTTP_PAGE, write_field_folder
from tests.support.compose import ROOT

PAGE = (ROOT / "docs" / "history.md").read_text(encoding="utf-8")


def commands(page):
    (block,) = re.findall(r"^```sh\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    return block


def audit(data, *arguments):
    return subprocess.run(
        [sys.executable, "-m", "store.audit_check", *arguments],
        check=False,
        cwd=ROOT,
        env=os.environ | {"STILB_DATA": str(data)},
        capture_output=True,
        text=True,
    )


@pytest.mark.skipif(shutil.which("curl") is None, reason="the commands are curl's")
def test_every_command_of_the_page_is_true(embedded, tmp_path):
    field = tmp_path / "field"
    write_field_folder(field)
    with embedded.team() as team:
        done = subprocess.run(
            ["sh", "-euc", f"{commands(HTTP_PAGE)}\necho -- history\n{commands(PAGE)}"],
            check=False,
            cwd=field,
            env=os.environ | {"STILB": team.url, "KEY": team.key},
            capture_output=True,
            text=True,
        )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    said = done.stdout.partition("-- history\n")[2].splitlines()
    still_open, ticked, impact, published, measurements, version, recall, confirmed, entries = said
    assert int(still_open) > int(json.loads(ticked)["open"])
    assert json.loads(impact)["against"]["version"] == 1
    assert json.loads(published)["state"] == "published"
    assert (measurements, version, confirmed) == ("[]", "2", "confirmed")
    assert [v["state"] for v in json.loads(recall)["versions"]] == ["superseded", "revoked"]
    assert {"calibration.create"} <= {entry["action"] for entry in json.loads(entries)["items"]}
    whole = audit(embedded.data)
    assert whole.returncode == 0, whole.stderr
    (head,) = re.findall(r"^head (\S+)$", whole.stdout, re.MULTILINE)
    assert audit(embedded.data, head).returncode == 0
    seq = head.partition(":")[0]
    assert audit(embedded.data, f"{seq}:{'0' * 64}").returncode == 1
