"""Style of the docstrings: how they open everywhere, and their sections in the science."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from radiometry.specification.method import MethodSpec

ROOT = Path(__file__).parents[2]
ROOMS = ("radiometry", "simulation", "store", "worker", "service", "stilb", "verify", "demo", "bench")
OPENINGS = frozenset(("Give", "Gives", "Say", "Tell", "Hold", "Holds", "Let", "Look", "Looks"))
OPENINGS |= {"What", "Who", "Of", "Whether", "From"}
INLINE = ("Takes", "Source:")
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef)


def test_docstrings_open_with_a_result_and_name_their_parameters():
    assert not [fault for path in list_files() for fault in find_faults(path, path.read_text())]


@pytest.mark.parametrize(
    ("source", "fault"),
    [
        ('def f():\n    """Give one."""', "opens with Give"),
        ('class F:\n    """What it is."""', "opens with What"),
        ('def f(x):\n    """Return x.\n\n    Takes x : m, a length\n    """', "has Takes"),
        ('def f(x):\n    """Return x."""', "has no Parameters section"),
        ("def f(x):\n    return x", "has no Parameters section"),
        ('class F:\n    def f(self, *, x):\n        """Return x."""', "has no Parameters section"),
    ],
)
def test_lint_finds_each_fault(source, fault):
    assert any(text.endswith(fault) for text in find_faults(ROOT / "radiometry/example.py", source))


def test_lint_accepts_numpydoc_and_private_helpers():
    source = (
        'def f(x):\n    """Return x.\n\n    Parameters\n    ----------\n    x : float\n    """\n'
        "def _g(x):\n    return x\n"
        "class F:\n    def __post_init__(self, x):\n        pass\n"
        '    def size(self):\n        """Return the size."""'
    )
    assert not list(find_faults(ROOT / "radiometry/example.py", source))


def test_functions_that_a_room_keeps_to_itself_need_no_sections():
    path = ROOT / "radiometry/frame/roi.py"
    assert not list(find_faults(path, 'def only_roi_knows(signal):\n    """Return True."""'))
    assert list(find_faults(path, 'def bounding_window(polygon):\n    """Return it."""'))


def test_simulation_needs_no_sections():
    assert not list(find_faults(ROOT / "simulation/example.py", 'def f(x):\n    """Return x."""'))


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
    if path.is_relative_to(ROOT / "radiometry"):
        for function in _list_public_functions(tree.body):
            arguments = [*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs]
            takes = [one for one in arguments if one.arg not in {"self", "cls"}]
            text = ast.get_docstring(function) or ""
            if takes and "Parameters\n----------\n" not in text and _is_used_outside(path, function.name):
                yield f"{path.relative_to(ROOT)}: {function.name} has no Parameters section"


def _is_used_outside(path: Path, name: str) -> bool:
    """Return True unless a room of the science keeps this function to itself: one sentence is then enough."""
    room = path.relative_to(ROOT / "radiometry").parts[0]
    if (ROOT / "radiometry" / room / "method.py").exists() and name in MethodSpec.__dataclass_fields__:
        return False  # the specification says what each method's function takes
    return not path.exists() or any(name in words for other, words in _list_words().items() if other != room)


@cache
def _list_words() -> dict[str, set[str]]:
    """Return the words of each room of radiometry, and of the rooms beside it together."""
    words: dict[str, set[str]] = {}
    for root in ("radiometry", "store", "worker", "service", "verify", "bench", "demo", "simulation"):
        for path in (ROOT / root).rglob("*.py"):
            room = path.relative_to(ROOT / root).parts[0] if root == "radiometry" else ""
            words.setdefault(room, set()).update(re.findall(r"\w+", path.read_text()))
    return words


def _list_public_functions(body: list[ast.stmt]) -> Iterator[ast.FunctionDef]:
    for node in body:
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            yield from _list_public_functions(node.body)
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
            yield node
