"""Configuration of the documentation site: the pages of `docs/`, and an API reference from docstrings."""

import sys
import tomllib
from inspect import isfunction
from pathlib import Path

from sphinx.application import Sphinx

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from service.pages.documentation import expand_entries  # noqa: E402

project = "stilb"
release = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
extensions = ["myst_parser", "sphinx.ext.apidoc", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
html_theme_options = {"page_width": "70rem", "sidebar_width": "16rem", "fixed_sidebar": True}
html_copy_source = False

# the anchors that readers of the repository see too
myst_heading_anchors = 4

apidoc_modules = [
    {
        "path": str(ROOT / package),
        "destination": f"reference/{package}",
        # the commands describe themselves: stilb --help
        "exclude_patterns": ["**/commands/**", "**/__main__.py"],
        "automodule_options": {"members"},
        "module_first": True,
        "max_depth": 3,
    }
    for package in ("radiometry", "stilb")
]
autodoc_member_order = "bysource"
# no link is sought for the type of each parameter and result: that search is long
napoleon_use_param = False
napoleon_use_rtype = False
napoleon_use_ivar = True

exclude_patterns = ["reference/*/modules.rst"]

# docutils: names between bars in formulae, as |d|; ref.python: one name in several dataclasses
suppress_warnings = ["docutils", "ref.python"]


def _leave_out_inner(*event: object) -> bool | None:
    """Keep to the functions of the science that other rooms import: those have sections."""
    shown = event[3]
    inner = isfunction(shown) and shown.__module__.startswith("radiometry.")
    return True if inner and "Parameters\n" not in (shown.__doc__ or "") else None


def _list_findings(_app: Sphinx, page: str, source: list[str]) -> None:
    source[0] = expand_entries(source[0], page)


def setup(app: Sphinx) -> None:
    """Leave out of the reference what only its own room calls, and list findings where a page says so."""
    app.connect("autodoc-skip-member", _leave_out_inner)
    app.connect("source-read", _list_findings)
