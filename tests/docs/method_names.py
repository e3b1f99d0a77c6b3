"""Lint: outside its package no code knows a calibration method by its name.

    python -m tests.docs.method_names

A method's name as a literal is an error where it is compared with, assigned to or given to something
called method, matched in a `case`, or listed beside the names of other methods; so is an import of its
package.
"luminance", "reflectance" and the other names remain free as names of quantities, columns and units.
"""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from radiometry.methods import METHODS

NAMES: Final = frozenset(spec.name for spec in METHODS)
ROOMS: Final = ("radiometry", "store", "worker", "service", "stilb", "verify")
# the list of the methods, and the default of the public client
ALLOWED: Final = frozenset({"radiometry/methods/__init__.py", "stilb/records.py"})


_NAME: Final = "|".join(sorted(NAMES))
_PACKAGE: Final = re.compile(rf"radiometry\.(?:{_NAME})\b")
_IN_SCRIPT: Final = re.compile(
    rf"""method\w*(?:\.value)?\s*[=!]==?\s*["'](?:{_NAME})["']"""
    rf"""|["'](?:{_NAME})["']\s*[=!]==?\s*[\w.]*method"""
    rf"""|\[\s*["'](?:{_NAME})["']\s*,\s*["'](?:{_NAME})["']"""
)


def find_in_python(text: str) -> Iterator[tuple[int, str]]:
    """Return line and reason of every place of a Python file that knows a method by its name."""
    for node in ast.walk(ast.parse(text)):
        reason = _judge_statement(node) or _judge_expression(node) or _judge_import(node)
        if reason:
            yield getattr(node, "lineno", 0), reason


def find_in_script(text: str) -> Iterator[tuple[int, str]]:
    """Return line and reason of every place of a script or template that knows a method by its name."""
    for number, line in enumerate(text.splitlines(), start=1):
        if _IN_SCRIPT.search(line):
            yield number, "a method is known by its name"


def find_all(root: Path) -> Iterator[tuple[str, int, str]]:
    """Return file, line and reason of every place in the rooms of the product."""
    listed = subprocess.run(["git", "ls-files", *ROOMS], cwd=root, capture_output=True, text=True, check=True)
    for name in listed.stdout.split():
        parts = name.split("/")
        if (parts[0] == "radiometry" and parts[1] in NAMES) or name in ALLOWED or not (root / name).exists():
            continue
        if name.endswith(".py"):
            found = find_in_python((root / name).read_text())
        elif name.endswith((".js", ".html")):
            found = find_in_script((root / name).read_text())
        else:
            continue
        yield from ((name, line, reason) for line, reason in found)


def main() -> int:
    """Print every place, and return 1 if there is one."""
    found = list(find_all(Path(__file__).parents[2]))
    for name, line, reason in found:
        sys.stdout.write(f"{name}:{line}: {reason}: ask its specification (radiometry/specification)\n")
    return int(bool(found))


def _judge_statement(node: ast.AST) -> str:
    match node:
        case ast.Assign(targets=targets, value=value) if any(map(_is_method, targets)) and _names(value):
            return "a name is assigned to a method"
        case ast.AnnAssign(target=target, value=value) if value and _is_method(target) and _names(value):
            return "a name is assigned to a method"
        case ast.Match(subject=subject, cases=cases) if _is_method(subject) and any(map(_matches, cases)):
            return "a name is matched"
        case ast.FunctionDef() | ast.AsyncFunctionDef() if _has_default(node.args):
            return "a name is the default of a method"
    return ""


def _judge_import(node: ast.AST) -> str:
    match node:
        case ast.ImportFrom(module=str(module), names=names):
            paths = [f"{module}.{each.name}" for each in names]
        case ast.Import(names=names):
            paths = [each.name for each in names]
        case _:
            return ""
    return "a method's package is imported" if any(map(_PACKAGE.match, paths)) else ""


def _judge_expression(node: ast.AST) -> str:
    match node:
        case ast.Compare(left=left, comparators=others):
            parts = [left, *others]
            if any(map(_is_method, parts)) and any(map(_names, parts)):
                return "a method is compared with a name"
        case ast.keyword(arg=str(named), value=value) if "method" in named.lower() and _names(value):
            return "a name is given as a method"
        case ast.Dict(keys=keys) if sum(_names(key) for key in keys if key) > 1:
            return "names are keys beside each other"
        case ast.Tuple(elts=parts) | ast.List(elts=parts) | ast.Set(elts=parts) if (
            sum(map(_names, parts)) > 1
        ):
            return "names are listed beside each other"
    return ""


def _names(node: ast.expr) -> bool:
    if isinstance(node, ast.Tuple | ast.List | ast.Set):
        return any(_names(part) for part in node.elts)
    return isinstance(node, ast.Constant) and node.value in NAMES


def _is_method(node: ast.expr) -> bool:
    match node:
        case ast.Name(id=name) | ast.Attribute(attr=name):
            return "method" in name.lower()
        case ast.Subscript(slice=ast.Constant(value=str(name))):
            return "method" in name.lower()
        case ast.Call(func=ast.Attribute(attr="get"), args=[ast.Constant(value=str(name)), *_]):
            return "method" in name.lower()
        case ast.Compare(left=left):
            return _is_method(left)
    return False


def _matches(case: ast.match_case) -> bool:
    return any(isinstance(node, ast.MatchValue) and _names(node.value) for node in ast.walk(case.pattern))


def _has_default(node: ast.arguments) -> bool:
    plain = [*node.posonlyargs, *node.args]
    pairs = [
        *zip(plain[len(plain) - len(node.defaults) :], node.defaults, strict=True),
        *zip(node.kwonlyargs, node.kw_defaults, strict=True),
    ]
    return any(default and "method" in named.arg.lower() and _names(default) for named, default in pairs)


if __name__ == "__main__":
    sys.exit(main())
