"""Compare the tree with budgets.toml, for `make lint`: its size, and that nothing binary strays into it."""

import ast
import subprocess
import sys
import tomllib
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def list_files() -> list[str]:
    """Return the files of the tree, with those that git does not know yet."""
    command = ("git", "ls-files", "--cached", "--others", "--exclude-standard", "--deduplicate")
    named = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    return sorted(name for name in named.splitlines() if (ROOT / name).is_file())


def count_lines(names: list[str]) -> int:
    return sum(bool(line.strip()) for n in names for line in (ROOT / n).read_text("utf-8").splitlines())


def count_imports(name: str) -> int:
    nodes = ast.walk(ast.parse((ROOT / name).read_bytes()))
    found = [node for node in nodes if isinstance(node, ast.Import | ast.ImportFrom)]
    return sum((node.end_lineno or node.lineno) - node.lineno + 1 for node in found)


def measure(names: list[str], rooms: list[str]) -> dict[str, float]:
    """Return what is reached of each budget; `rest` is every other room but tests and migrations."""
    apart = [name for name in names if not name.startswith(("tests/", "migrations/"))]
    code = [name for name in apart if name.endswith(".py")]
    of_room = {room: [name for name in code if name.startswith(f"{room}/")] for room in rooms}
    named = {name for files in of_room.values() for name in files}
    of_room["rest"] = [name for name in code if name not in named]
    pages = [name for name in apart if name.endswith(".md") and name.startswith(("docs/", "README"))]
    lines = count_lines(code)
    return {
        **{room: count_lines(files) for room, files in of_room.items()},
        "source": lines,
        "files": len(code),
        "files_in_a_folder": max(Counter(name.rpartition("/")[0] for name in code).values()),
        "imports_percent": round(100 * sum(map(count_imports, code)) / lines, 1),
        "tests": count_lines([n for n in names if n.startswith("tests/") and n.endswith(".py")]),
        "javascript": count_lines([name for name in apart if name.endswith(".js")]),
        "words_of_docs": sum(len((ROOT / name).read_text("utf-8").split()) for name in pages),
    }


def find_strays(names: list[str], known: list[str]) -> list[str]:
    """Return binary files that are not named, such as a database or the dump of an image."""
    return [n for n in names if not n.startswith(tuple(known)) and b"\0" in (ROOT / n).read_bytes()]


def main() -> int:
    """Print each size beside its budget; return 1 if one is above, or a file has no place here."""
    tree, limits = list_files(), tomllib.loads((ROOT / "budgets.toml").read_text("utf-8"))
    at_most = limits["at_most"]
    reached = measure(tree, ["radiometry", "service", "store", "worker", "stilb"])
    lines = [f"{what:<18}{size:>8} of {at_most[what]:>6}" for what, size in reached.items()]
    wrong = [f"{what} is above its budget" for what, size in reached.items() if size > at_most[what]]
    wrong += [f"{name} is binary: see budgets.toml" for name in find_strays(tree, limits["binary"]["named"])]
    sys.stdout.writelines(f"{line}\n" for line in [*lines, *wrong])
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
