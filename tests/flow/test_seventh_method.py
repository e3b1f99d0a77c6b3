"""A method is one package and one name in the tuple: a seventh goes all the way with nothing else edited."""

import os
import shutil
import subprocess
import sys
from importlib.util import cache_from_source
from itertools import chain

from tests.support.compose import ROOT

SEVENTH = ROOT / "tests" / "seventh"


def test_a_seventh_method_is_one_package_and_one_name(tmp_path):
    tree = tmp_path / "tree"
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True, text=True)
    names = listed.stdout.strip("\0").split("\0")
    # with what is compiled: else every module would be compiled again
    compiled = (
        name for path in names if path.endswith(".py") and (ROOT / (name := cache_from_source(path))).exists()
    )
    for name in chain(names, compiled):
        (tree / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, tree / name)
    shutil.copytree(SEVENTH / "brightness", tree / "radiometry" / "brightness")
    shutil.copy(SEVENTH / "brightness.md", tree / "docs")
    methods = tree / "radiometry" / "methods" / "__init__.py"
    text = methods.read_text(encoding="utf-8")
    text = text.replace("from radiometry import ", "from radiometry import brightness, ", 1)
    methods.write_text(
        text.replace("    noise.SPEC,\n", "    noise.SPEC,\n    brightness.SPEC,\n", 1), "utf-8"
    )
    pages = [f"tests/docs/test_{name}.py" for name in ("tables", "docs")]
    for words in (
        ["docs/tables.py"],  # what `make tables` runs: it writes what is derived
        ["-m", "tests.seventh.steps"],
        # the list of pages in README is written by hand
        ["-m", "pytest", "-q", "--noconftest", "-p", "no:cacheprovider", *pages, "-k", "not reached"],
    ):
        done = subprocess.run(
            [sys.executable, *words],
            cwd=tree,
            env=os.environ | {"PYTHONPATH": str(tree), "PYTEST_ADDOPTS": ""},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, f"{words}: {done.stdout[-3000:]}{done.stderr[-3000:]}"
