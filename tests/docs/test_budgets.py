"""The budgets of size count what they say, and find what does not belong into the tree."""

import pytest

from tests.docs import budgets

pytestmark = pytest.mark.unit

FILES = {
    "radiometry/fit.py": b"import math\n\nfrom a import (\n    b,\n)\n\nK = 1.0\n",
    "radiometry/sub/a.py": b"A = 1\n",
    "demo/go.py": b"B = 2\n",
    "tests/test_fit.py": b"C = 3\n\nD = 4\n",
    "docs/fit.md": b"# Fit\n\nThree words here.\n",
    "service/page.js": b"let a;\n",
    "c.sqlite": b"SQLite format 3\0",
    "docs/pictures/a.webp": b"RIFF\0",
}


@pytest.fixture
def tree(tmp_path, monkeypatch):
    monkeypatch.setattr(budgets, "ROOT", tmp_path)
    for name, content in FILES.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(content)
    return sorted(FILES)


def test_sizes_are_counted_by_room(tree):
    assert budgets.measure(tree, ["radiometry", "service"]) == {
        "radiometry": 6,
        "service": 0,
        "rest": 1,
        "source": 7,
        "files": 3,
        "files_in_a_folder": 1,
        "imports_percent": pytest.approx(57.1),
        "tests": 2,
        "javascript": 1,
        "words_of_docs": 5,
    }


def test_a_database_is_found_and_named_pictures_are_not(tree):
    assert budgets.find_strays(tree, ["docs/pictures/"]) == ["c.sqlite"]


def test_a_size_above_its_budget_is_named_and_fails(tree, tmp_path, monkeypatch, capsys):
    reached = budgets.measure(tree, ["radiometry", "service", "store", "worker", "stilb"])
    (tmp_path / "budgets.toml").write_text(
        "[at_most]\n"
        + "".join(f"{name} = {size - (name == 'tests')}\n" for name, size in reached.items())
        + "[binary]\nnamed = ['docs/pictures/', 'c.sqlite']\n"
    )
    monkeypatch.setattr(budgets, "list_files", lambda: tree)
    assert budgets.main() == 1
    assert "above" in (shown := capsys.readouterr().out)
    assert "tests is above its budget" in shown
