"""The picture of the rooms and their table are drawn from today's imports."""

import importlib.util
import subprocess
from xml.etree import ElementTree as ET

import pytest

from tests.support.compose import ROOT

DRAWER = ROOT / "docs" / "architecture.py"


@pytest.fixture(scope="module")
def architecture():
    spec = importlib.util.spec_from_file_location("architecture", DRAWER)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_picture_and_table_are_current(architecture):
    for path, text in architecture.render().items():
        assert path.read_text(encoding="utf-8") == text, f"make architecture renews {path.name}"


def test_every_folder_of_code_is_on_the_page(architecture):
    listed = subprocess.run(
        ["git", "ls-files", "*.py"], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout.splitlines()
    page = architecture.PAGE.read_text(encoding="utf-8")
    assert [name for name in {path.partition("/")[0] for path in listed} if f"`{name}/`" not in page] == []


def test_implied_arrows_are_left_out_and_rooms_are_above_what_they_import(architecture):
    graph = {
        "a": frozenset("bc"),
        "b": frozenset("c"),
        "c": frozenset(),
        "d": frozenset("c"),
        "e": frozenset("ad"),
    }
    reduced = architecture.reduce(graph)
    assert reduced["a"] == frozenset("b")
    assert reduced["e"] == frozenset("ad")
    assert architecture.rank(reduced) == {"c": 0, "b": 1, "a": 2, "d": 2, "e": 3}


def test_long_arrow_passes_each_level_between(architecture):
    graph = {
        "a": frozenset("bx"),
        "b": frozenset("c"),
        "c": frozenset("d"),
        "d": frozenset(),
        "x": frozenset("d"),
    }
    rows, steps = architecture.arrange(graph, {"a": 3, "b": 2, "c": 1, "d": 0, "x": 2})
    assert rows[2] == ["c", "x>d@1"] or rows[2] == ["x>d@1", "c"]
    assert ("x", "x>d@1") in steps
    assert ("x>d@1", "d") in steps


def test_picture_names_every_room_and_is_well_formed(architecture):
    picture = architecture.draw({"top": frozenset({"low"}), "low": frozenset()}, {"top": ["a<b"], "low": []})
    words = [text.text for text in ET.fromstring(picture).iter("{http://www.w3.org/2000/svg}text")]
    assert words == ["low/", "top/", "a<b"]
