"""What a dashboard reads with SQL: the views' columns stay, and their role reads nothing else."""

import pytest
from sqlalchemy import text
from sqlalchemy.exc import ProgrammingError

from tests.support.campaigns import published_campaign
from tests.support.measuring import field_frame, measure
from tests.support.printed import read_blocks

COLUMNS = {
    "coefficients": {
        *("organisation", "camera_id", "make", "model_name", "serial", "method", "version", "calibration_id"),
        *("name", "value", "standard_uncertainty", "unit", "iso", "f_number", "band", "channel", "model"),
        *("valid_from", "valid_to", "reason"),
    },
    "measurements": {
        *("organisation", "measurement_id", "camera_id", "campaign_id", "frame_id", "filename", "method"),
        *("calibration_id", "calibration_version", "value", "standard_uncertainty", "unit", "created_at"),
        *("taken_at", "taken_from", "taken_to"),
    },
    "cameras": {
        *("organisation", "camera_id", "make", "model_name", "serial", "lens_make", "lens_model"),
        *("lens_serial", "pixel_pitch_um", "created_at"),
    },
    "jobs": {"organisation", "job_id", "kind", "state", "attempt", "created_at", "finished_at"},
}


def test_the_views_say_what_the_api_says(house, staged):
    version = staged(published_campaign, isos=(3200,))
    measured = measure(house, field_frame(house, version["campaign_id"]), version)
    separator = "_" if house.database.is_sqlite else "."
    with house.database.engine.connect() as connection:
        found = {
            name: connection.execute(text(f"SELECT * FROM api_v1{separator}{name}")).mappings().all()
            for name in COLUMNS
        }
    assert {name: set(rows[0].keys()) for name, rows in found.items()} == COLUMNS
    series = house.get("/v1/series/coefficients")["rows"]
    assert {(row["name"], row["value"]) for row in found["coefficients"]} == {
        (row["name"], row["value"]) for row in series
    }
    (row,) = found["measurements"]
    assert {name: row[name] for name in ("value", "standard_uncertainty", "unit")} == measured["mean"]
    (said,) = house.get("/v1/series/measurements")["rows"]
    assert (row["camera_id"], row["taken_at"]) == (said["camera_id"], said["taken_at"])
    assert str(row["taken_from"])[:19].replace(" ", "T") == said["taken_at"][:19]
    assert [row["serial"] for row in found["cameras"]] == ["0K1XE8"]
    assert {row["state"] for row in found["jobs"]} == {"succeeded"}


@pytest.mark.parametrize("database_url", ["postgresql"], indirect=True)  # SQLite has no roles
def test_the_role_reads_the_views_and_nothing_else(database):
    (block,) = read_blocks("docs/dashboards.md", "sql")
    made, asked = block.strip().removesuffix(";").split(";\n")
    with database.engine.connect() as connection:
        connection.execute(text(made))
        connection.execute(text("SET LOCAL ROLE board"))
        connection.execute(text(asked))
        for statement in ("SELECT * FROM calibration", "INSERT INTO slot VALUES (1, 'a', 'b', 'c')"):
            with pytest.raises(ProgrammingError, match="permission denied"), connection.begin_nested():
                connection.execute(text(statement))
