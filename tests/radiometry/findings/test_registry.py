"""The registry: every entry is complete, declared once, and raised somewhere; what is raised is in it."""

import ast
import copy
import pickle
import re
from functools import cache
from pathlib import Path

import pytest

from radiometry.findings import Finding, declare, flag
from radiometry.findings.grouping import Occurrence, group_findings
from radiometry.findings.shared import RENDERED, ROI_EMPTY
from radiometry.methods.findings import FINDINGS, collect_findings

ROOT = Path(__file__).parents[3]
DECLARING = {"flag", "flag_measurement", "flag_both", "reason", "warn", "fail", "error"}
DECLARING |= {"_refusal", "_failure", "_gap"}
DECLARED = re.compile(r"radiometry/(findings/\w+|\w+/codes)\.py")


@cache
def read_code() -> tuple[set[str], set[str]]:
    """Return the names that modules use which declare no finding, and the codes that any module declares."""
    used, declared = set(), set()
    for room in ("radiometry", "store", "worker", "service"):
        for path in (ROOT / room).rglob("*.py"):
            place = f"{path.relative_to(ROOT)}"
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.Attribute | ast.Name) and not DECLARED.fullmatch(place):
                    used.add(node.attr if isinstance(node, ast.Attribute) else node.id)
                elif isinstance(node, ast.Assign) and _declares(place, node.value):
                    declared |= {each.id.lower() for each in node.targets if isinstance(each, ast.Name)}
    return used, declared


def test_every_entry_is_complete():
    for finding in FINDINGS.values():
        assert re.fullmatch(r"[a-z][a-z_0-9]+", finding.code)
        assert finding.where
        for text in (finding.sentence, finding.remedy):
            assert re.fullmatch(r"[^\s].*[^\s.]\.", text)
            assert text[0].isupper() or text[0] in "`uf"


def test_every_declared_entry_is_raised():
    used, _ = read_code()
    # of stored versions alone
    assert [code for code in FINDINGS if code.upper() not in used] == ["corner_window_wide"]


def test_every_entry_is_declared_in_a_module_that_is_collected():
    _, declared = read_code()
    assert declared == {*FINDINGS}


def _declares(path: str, value: ast.expr) -> bool:
    """Return True if a value is a call that makes an entry; outside the registry there is to be none."""
    name = getattr(value.func, "id", "") if isinstance(value, ast.Call) else ""
    return name == "Finding" or (name in DECLARING and path.startswith("radiometry"))


def test_a_code_declared_twice_is_refused():
    with pytest.raises(ValueError, match="declared twice: rendered"):
        collect_findings((RENDERED,), declare({"RENDERED": flag("Another.", "Nothing.")}))


def test_an_entry_is_its_code():
    assert RENDERED == "rendered"
    assert {RENDERED: 1}["rendered"] == 1
    assert f"{RENDERED}" == "rendered"
    assert pickle.loads(pickle.dumps(RENDERED)).remedy == RENDERED.remedy
    assert copy.deepcopy(RENDERED).where == RENDERED.where
    assert type(RENDERED.at("", "").flag) is str


def test_a_reason_is_as_grave_as_its_entry():
    assert RENDERED.reason("").outcome == "warn"
    assert RENDERED.reason("", "fail").outcome == "fail"
    assert ROI_EMPTY.reason("").outcome == "fail"


def test_a_refusal_ends_with_the_remedy():
    refused = ROI_EMPTY.refuse("It is small.")
    assert refused.message == f"It is small. {ROI_EMPTY.remedy}"
    assert isinstance(refused.code, Finding)


def test_a_group_keeps_what_was_found_at_each_subject():
    found = [
        Occurrence(finding=RENDERED, severity="warn", subject=subject, detail=detail)
        for subject, detail in (("frame a", "R."), ("frame a", "B."), ("", "All."))
    ]
    (group,) = group_findings(found)
    assert (group.count, group.subjects, group.detail) == (3, ("frame a", "frame a", ""), RENDERED.sentence)
    assert group.values == {"detail": ("R.", "B.", "All.")}
    (group,) = group_findings(found[:1] * 2)
    assert (group.detail, group.sentence, group.values) == ("R.", RENDERED.sentence, {})


def test_what_pages_tell_people_to_do_is_no_request():
    """Only a refused request, which a program sent, is answered with another one."""
    shown = [each for each in FINDINGS.values() if set(each.where) != {"request"}]
    assert [each.code for each in shown if "/v1/" in each.sentence + each.remedy] == []
