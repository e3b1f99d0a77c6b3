"""Style of the docstrings: how they open everywhere, and which of the science have sections."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCIENCE = ROOT / "radiometry"
# what presents the science is no part of it: one line is enough there
PRESENTING = ("checklist.py", "drawing", "findings", "methods", "records.py", "specification")
CALLERS = ("store", "worker", "service")
ROOMS = ("radiometry", "stilb", "bench", "simulation", "verify", "demo", *CALLERS)
OPENINGS = frozenset(("Give", "Gives", "Say", "Tell", "Hold", "Holds", "Let", "Look", "Looks"))
OPENINGS |= {"What", "Who", "Of", "Whether", "From"}
INLINE = ("Takes", "Source:")
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef)
PARAMETERS = "Parameters\n----------\n"


def test_docstrings_follow_the_style():
    assert not [fault for path in list_files() for fault in find_faults(path, path.read_text())]


@pytest.mark.parametrize(
    ("source", "fault"),
    [
        ('def f():\n    """Give one."""', "opens with Give"),
        ('class F:\n    """What it is."""', "opens with What"),
        ('def f(x):\n    """Return x.\n\n    Takes x : m, a length\n    """', "has Takes"),
        ('def is_ragged(x):\n    """Return x."""', "has no Parameters section"),
        ("def is_ragged(x):\n    return x", "has no Parameters section"),
        (f'def g(x):\n    """Return x.\n\n    {PARAMETERS}    x : float"""', "needs no Parameters section"),
    ],
)
def test_lint_finds_each_fault(source, fault):
    source = source.replace("\n----------", "\n    ----------")
    assert any(text.endswith(fault) for text in find_faults(SCIENCE / "maps.py", source))


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("radiometry/maps.py", f'def is_ragged(x):\n    """Return x.\n\n    {PARAMETERS}    x : float"""'),
        ("radiometry/maps.py", 'def g(x):\n    """Return x."""'),
        ("radiometry/maps.py", "class F:\n    def h(self, x):\n        return x"),
        ("radiometry/drawing/chart.py", 'def document(x):\n    """Return x."""'),
        ("simulation/example.py", 'def f(x):\n    """Return x."""'),
    ],
)
def test_lint_accepts_sections_of_the_public_science_and_one_line_elsewhere(path, source):
    assert not list(find_faults(ROOT / path, source.replace("\n----------", "\n    ----------")))


def list_files() -> list[Path]:
    return [path for room in ROOMS for path in (ROOT / room).rglob("*.py")]


def find_faults(path: Path, source: str) -> Iterator[str]:
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if not isinstance(node, DOCUMENTED):
            continue
        text = ast.get_docstring(node) or ""
        where = f"{path.relative_to(ROOT)}: {getattr(node, 'name', 'module')}"
        if (first := text.split(" ")[0]) in OPENINGS:
            yield f"{where} opens with {first}"
        yield from (f"{where} has {word}" for word in INLINE if f"\n{word}" in text)
    if path.is_relative_to(SCIENCE):
        yield from _find_section_faults(path, tree)


def _find_section_faults(path: Path, tree: ast.Module) -> Iterator[str]:
    """Sections are for the functions that the product's other rooms import, and only there."""
    presents = path.relative_to(SCIENCE).parts[0] in PRESENTING
    public = set() if presents else _list_imported().get(path, set())
    shown = {each for each in tree.body if isinstance(each, ast.FunctionDef) and each.name in public}
    for node in ast.walk(tree):
        if not isinstance(node, ast.FunctionDef):
            continue
        arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
        takes = any(one.arg not in {"self", "cls"} for one in arguments)
        has_section = PARAMETERS in (ast.get_docstring(node) or "")
        if node in shown and takes and not has_section:
            yield f"{path.relative_to(ROOT)}: {node.name} has no Parameters section"
        if node not in shown and has_section:
            yield f"{path.relative_to(ROOT)}: {node.name} needs no Parameters section"


@cache
def _list_imported() -> dict[Path, set[str]]:
    """Return the names that the product's other rooms use of each module of the science."""
    imported: dict[Path, set[str]] = {}
    for path in (path for room in CALLERS for path in (ROOT / room).rglob("*.py")):
        nodes = list(ast.walk(ast.parse(path.read_text())))
        modules: dict[str, Path] = {}
        for node in nodes:
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("radiometry"):
                folder = ROOT / node.module.replace(".", "/")
                modules |= {
                    each.asname or each.name: _find_file(folder / each.name)
                    for each in node.names
                    if _is_module(folder / each.name)
                }
                names = {each.name for each in node.names} - modules.keys()
                imported.setdefault(_find_file(folder), set()).update(names)
        for node in nodes:
            if (
                isinstance(node, ast.Attribute)
                and isinstance(node.value, ast.Name)
                and node.value.id in modules
            ):
                imported.setdefault(modules[node.value.id], set()).add(node.attr)
    return imported


def _find_file(module: Path) -> Path:
    return one if (one := module.with_suffix(".py")).is_file() else module / "__init__.py"


def _is_module(path: Path) -> bool:
    return path.is_dir() or path.with_suffix(".py").exists()
