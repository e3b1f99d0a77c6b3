"""The tables of the methods' pages are those that the specifications give."""

import importlib.util

from tests.support.compose import ROOT


def test_tables_are_current():
    spec = importlib.util.spec_from_file_location("tables", ROOT / "docs" / "tables.py")
    tables = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tables)
    for page, text in tables.render().items():
        assert page.read_text(encoding="utf-8") == text, f"make tables renews {page.name}"
