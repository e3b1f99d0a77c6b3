"""What CSV makes of values that are no single figure."""

from service.tabular import write_csv


def test_a_list_becomes_its_length_and_members_become_columns():
    row = {"a": 1, "spots": [{"x": 1}, {"x": 2}], "at": {"row": 0.5, "deep": {"b": "=1"}}, "none": None}
    assert write_csv([row]).splitlines() == ["a,spots_count,at_row,at_deep_b,none", "1,2,0.5,'=1,"]
