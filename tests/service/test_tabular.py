"""What CSV makes of values that are no single figure, and series of text that needs quotes."""

import csv
import io
import json

from service import series
from service.tabular import write_csv
from store.ready import measurement_series
from store.ready.measurements import COLUMNS

TEXTS = ("plain", 'a "b", c', "a, b", "50 %s", "back\\slash", "Zürich", "=SUM(A1)", "", "a\tb")


def test_a_list_becomes_its_length_and_members_become_columns():
    row = {"a": 1, "spots": [{"x": 1}, {"x": 2}], "at": {"row": 0.5, "deep": {"b": "=1"}}, "none": None}
    assert write_csv([row]).splitlines() == ["a,spots_count,at_row,at_deep_b,none", "1,2,0.5,'=1,"]


def test_series_writes_any_text_in_every_way():
    columns = tuple(
        series.Column(name=name, kind=kind, empty="null") for name, kind in (("a", "text"), ("b", "number"))
    )
    for text in TEXTS:
        page = [[text, "other"], ["1.5", ""]]
        rows = json.loads(b"".join(series._write_json(iter([page]), columns, None)))["rows"]
        assert rows == [{"a": text or None, "b": 1.5}, {"a": "other", "b": None}]
        written = b"".join(series.write_csv(iter([[*page]]), columns)).decode()
        shown = f"'{text}" if text.startswith("=") else text
        assert [*csv.reader(io.StringIO(written, newline=""))] == [["a", "b"], [shown, "1.5"], ["other", ""]]
        record = io.StringIO()
        csv.writer(record, lineterminator="").writerow([text] * len(COLUMNS))
        assert [*measurement_series._split([record.getvalue()] * 2)[1]] == [text] * 2
