"""The table of the rooms is that of today's imports."""

import ast
import subprocess
import tomllib

import grimp

from tests.support.compose import ROOT

PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")


def test_the_table_has_every_room_and_its_imports():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    rooms = project["tool"]["importlinter"]["root_packages"]
    graph = grimp.build_graph(*rooms, cache_dir=None)
    imported = {room: set() for room in rooms}
    for module in graph.modules:
        room = module.partition(".")[0]
        targets = graph.find_modules_directly_imported_by(module)
        imported[room] |= {target.partition(".")[0] for target in targets} - {room}
    for room, others in imported.items():
        text = ast.get_docstring(ast.parse((ROOT / room / "__init__.py").read_text(encoding="utf-8")))
        said = ", ".join(sorted(others)) or "nothing of ours"
        assert f"| `{room}/` | {text.splitlines()[0]} | {said} |" in PAGE


def test_every_folder_of_code_is_on_the_page():
    command = ["git", "ls-files", "*.py"]
    listed = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    folders = {path.partition("/")[0] for path in listed.splitlines()}
    assert [name for name in folders if f"`{name}/`" not in PAGE] == []
