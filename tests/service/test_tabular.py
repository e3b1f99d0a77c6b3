"""What CSV makes of values that are no single figure, and series of text that needs quotes."""

import csv
import io
import json
import re

from service.coefficients import series as series_texts
from service.http.tables import write_csv
from store.ready.rows import read_records, write_record

TEXTS = (
    "plain",
    "\uff1d1",
    "x;=SUM(A1)",
    "x;-1",
    'a "b", c',
    "a, b",
    "50 %s",
    "back\\slash",
    "Zürich",
    "=SUM(A1)",
    "",
    "a\tb",
)


def test_a_list_becomes_its_length_and_members_become_columns():
    row = {"a": 1, "spots": [{"x": 1}, {"x": 2}], "at": {"row": 0.5, "deep": {"b": "=1"}}, "none": None}
    assert write_csv([row]).splitlines() == ["a,spots_count,at_row,at_deep_b,none", "1,2,0.5,'=1,"]


def test_series_writes_any_text_in_every_way():
    columns = tuple(
        series_texts.Column(name=name, kind=kind, empty="null")
        for name, kind in (("a", "text"), ("b", "number"))
    )
    for text in TEXTS:
        page = [write_record([text, -1.5]), write_record(["other", None])]
        rows = json.loads(b"".join(series_texts.write_json(iter([page]), columns, None)))["rows"]
        assert rows == [{"a": text or None, "b": -1.5}, {"a": "other", "b": None}]
        written = b"".join(series_texts.write_csv(iter([page]), columns)).decode()
        shown = re.sub("(^|;)(?=[=\uff1d-])", r"\1'", text)
        assert [*csv.reader(io.StringIO(written, newline=""))] == [["a", "b"], [shown, "-1.5"], ["other", ""]]
        assert read_records("\n".join([*page, write_record(["a\nb", 1])])) == [*page, '"a\nb",1']
