"""What docs/install.md and docs/deploy name exists.

The commands for a laptop make the environment of the tests; the others need root, systemd, containers or a
domain of one's own.
"""

import json
import re

import pytest

from service.command import COMMANDS
from tests.support.compose import ROOT

pytestmark = pytest.mark.unit
INSTALL = (ROOT / "docs" / "install.md").read_text(encoding="utf-8")


def test_commands_files_and_variables_of_the_page_exist():
    used = set(re.findall(r"(?:bin/|^|`)stilb-server ([a-z-]+)", INSTALL, re.MULTILINE))
    assert used
    assert used <= COMMANDS.keys()
    files = set(re.findall(r"(?<!/)docs/deploy/[\w.-]+|(?<=\]\()deploy/[\w.-]+", INSTALL))
    assert {f"docs/{each.removeprefix('docs/')}" for each in files} == {
        f"docs/deploy/{path.name}" for path in (ROOT / "docs" / "deploy").iterdir()
    }


def test_the_policy_of_the_bucket_allows_what_is_done_and_no_more():
    policy = json.loads((ROOT / "docs/deploy/s3-policy.json").read_text())
    allowed = {action for each in policy["Statement"] for action in each["Action"]}
    done = set(re.findall(r"obstore\.(\w+)\(", (ROOT / "store/blobs/objects.py").read_text()))
    assert done == {"get", "head", "list_with_delimiter", "put"}
    assert allowed == {"s3:GetObject", "s3:PutObject", "s3:AbortMultipartUpload", "s3:ListBucket"}
