"""What CSV makes of values that are no single figure, and series of text that needs quotes."""

import csv
import io
import json
import re

import arro3.io
import pytest

from service.coefficients import series as series_texts
from service.coefficients.series import write_arrow
from service.http.tables import write_csv
from store.ready.rows import read_records, write_record

EXCEL = {
    ("text", "0012"): '="0012"',
    ("text", "1-2"): '="1-2"',
    ("text", "MAR1"): '="MAR1"',
    ("text", "7 Sept"): '="7 Sept"',
    ("text", "50 %"): '="50 %"',
    ("text", "True"): '="True"',
    ("text", "MARS1"): "MARS1",
    ("text", "=HYPERLINK(1)"): "'=HYPERLINK(1)",
    ("text", "a;=1+1"): "a;'=1+1",
    ("text", "Zürich"): "Zürich",
    ("text", "2026-05-01T12:00:00"): "2026-05-01 12:00:00",
    ("text", "2026-05-01T12:00:00Z"): "2026-05-01T12:00:00Z",
    ("instant", "2026-05-01T12:00:00.123456Z"): "2026-05-01 12:00:00{}123",
    ("number", "-1.5e-07"): "-1{}5e-07",
    ("number", ""): "",
}
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


def name_columns(**kinds):
    return tuple(series_texts.Column(name=name, kind=kind, empty="null") for name, kind in kinds.items())


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
        kept = series_texts.write_records(iter([page]), columns)
        found = b"".join(write_arrow(kept, {column.name: column.kind for column in columns}))
        table = arro3.io.read_ipc_stream(io.BytesIO(found)).read_all()
        assert [column.to_pylist() for column in table.columns] == [
            [row[name] for row in rows] for name in "ab"
        ]
        assert read_records("\n".join([*page, write_record(["a\nb", 1])])) == [*page, '"a\nb",1']


@pytest.mark.parametrize(("separator", "decimal"), [(",", "."), (";", ",")])
def test_excel_takes_cells_for_what_they_are(separator, decimal):
    columns = tuple(
        series_texts.Column(name=f"c{n}", kind=kind, empty="null") for n, (kind, _) in enumerate(EXCEL)
    )
    page = [write_record([cell for _, cell in EXCEL])]
    written = b"".join(series_texts.write_excel(iter([page]), columns, separator, decimal))
    assert written.startswith(b"\xef\xbb\xbfc0" + separator.encode())
    _, row = csv.reader(io.StringIO(written.decode("utf-8-sig"), newline=""), delimiter=separator)
    assert row == [shown.format(decimal) for shown in EXCEL.values()]
