"""A row that was changed in SQL is found, because the trail says otherwise."""

import pytest
from sqlalchemy import text

from store.audit_check import check_rows, main
from store.tables import AuditEntry, Camera, ChecklistTick, Organisation, utc_now
from tests.support.campaigns import published_campaign
from tests.support.everything import make_one_of_each

HELD = ("calibration", "coefficient", "extraction", "channel_statistics", "measurement", "panel", "roi")
NEW_METER = (
    "INSERT INTO meter (id, organisation_id, kind, make, model, serial, created_at) "
    "SELECT 'met_x', organisation_id, kind, make, model, 'x', created_at FROM meter WHERE kind = 'luminance'"
)
NEW_COEFFICIENT = (
    "INSERT INTO coefficient SELECT calibration_id, 77, name, value, standard_uncertainty, unit, iso, "
    "f_number, band, channel, model, flags FROM coefficient WHERE position = 0"
)

BULK = {"result_sha256", "inputs_sha256", "header_sha256", "proof_sha256"}


@pytest.fixture
def lived_in(house, staged):
    """One of each thing, on a database whose owner has taken the triggers away."""
    ids = staged(make_one_of_each)
    with house.database.engine.begin() as connection:
        for table in HELD:
            on = "" if house.database.is_sqlite else f" ON {table}"
            connection.execute(text(f"DROP TRIGGER {table}_never_changes{on}"))
            if house.database.is_sqlite:
                connection.execute(text(f"DROP TRIGGER {table}_never_goes"))
        on = "" if house.database.is_sqlite else " ON publication"
        connection.execute(text(f"DROP TRIGGER publication_only_closed{on}"))
    return house.database, ids


def tamper(database, statement):
    with database.engine.begin() as connection:
        assert connection.execute(text(statement)).rowcount > 0, statement


def test_what_nobody_touched_stands_as_the_trail_says(lived_in):
    database, _ = lived_in
    report = check_rows(database)
    assert (report.faults, report.unrecorded) == ([], 0)
    assert report.compared > 30


@pytest.mark.either_database
@pytest.mark.parametrize(
    ("statement", "faults"),
    [
        ("UPDATE reading SET value = value * 1.01", "value is "),
        ("UPDATE reading SET withdrawn_at = created_at WHERE id = '{reading_id}'", "withdrawn_at is "),
        ("UPDATE coefficient SET value = value * 1.01", "0: is not what the trail says: edited"),
        (
            "UPDATE coefficient SET standard_uncertainty = 0 WHERE position = 0",
            "0: is not what the trail says",
        ),
        ("UPDATE calibration SET version = version + 1", "version is "),
        (
            "UPDATE channel_statistics SET mean_dn = mean_dn + 0.5 WHERE channel = 'G1'",
            " G1: is not what the",
        ),
        ("UPDATE measurement SET created_by = 'nobody'", "created_by is "),
        ("UPDATE publication SET valid_from = '2020-01-01 00:00:00'", "valid_from is "),
        ("UPDATE api_key SET scopes = '[\"admin\"]' WHERE id = '{key_id}'", "scopes is "),
        ("UPDATE api_key SET expires_at = '2099-01-01 00:00:00' WHERE id = '{key_id}'", "expires_at is "),
        (f"UPDATE api_key SET sha256 = '{'1' * 64}' WHERE id = '{{key_id}}'", "sha256 is not what the trail"),
        ("UPDATE camera SET pixel_pitch_um = 3.3", "pixel_pitch_um is "),
        ("UPDATE frame SET role = 'field' WHERE role <> 'field'", "role is "),
        ("UPDATE extraction SET extractor = 'other'", "extractor is "),
        ("UPDATE panel SET bands = '[]'", "bands is "),
        (
            "UPDATE meter SET certificate_due_on = '2099-01-01', certificate_issued_on = '2020-01-01'",
            "due_on is ",
        ),
        ("DELETE FROM coefficient WHERE position = 0", "0: is missing: deleted"),
        ("DELETE FROM reading WHERE id = '{reading_id}'", "is missing: deleted without an entry"),
        (NEW_METER, "met_x: has no entry: inserted without one"),
        (NEW_COEFFICIENT, " 77: has no entry: inserted without one"),
    ],
)
def test_what_was_changed_in_sql_is_named(lived_in, statement, faults):
    database, ids = lived_in
    tamper(database, statement.format_map(ids))
    report = check_rows(database)
    assert report.faults
    table = statement.split()[2 if statement.startswith(("DELETE", "INSERT")) else 1]
    assert all(fault.startswith(f"{table} ") for fault in report.faults)
    assert any(faults in fault for fault in report.faults), report.faults


@pytest.mark.either_database
@pytest.mark.parametrize(
    ("table", "column"), [("calibration", "result"), ("measurement", "result"), ("frame", "header")]
)
def test_bulk_that_was_changed_is_named(lived_in, table, column):
    database, _ = lived_in
    tamper(database, f"UPDATE {table} SET {column} = '{{}}'")
    report = check_rows(database)
    assert {fault.partition(": ")[2] for fault in report.faults} == {
        f"{column} is not what the trail says: edited"
    }


def test_the_command_names_it_and_fails(lived_in, monkeypatch, capsys):
    database, ids = lived_in
    monkeypatch.setenv("STILB_DATABASE_URL", database.url.render_as_string(hide_password=False))
    assert main([]) == 0
    assert "the rows are as it left them: " in capsys.readouterr().out
    tamper(database, f"UPDATE reading SET value = 12.5 WHERE id = '{ids['reading_id']}'")
    assert main([]) == 1
    said = capsys.readouterr().err
    assert f"reading {ids['reading_id']}: value is 12.5, the trail says " in said
    assert "1 rows or fields are not as the audit trail left them" in said


def test_what_is_older_than_its_record_is_counted(house, staged):
    """As an upgrade finds it: results without their hash, coefficients and statistics without an entry."""
    staged(published_campaign, isos=(3200,))
    database = house.database
    with database.engine.begin() as connection:
        for name in ("audit_entry_never_changes", "audit_entry_never_goes")[: 2 if database.is_sqlite else 1]:
            connection.execute(text(f"DROP TRIGGER {name}{'' if database.is_sqlite else ' ON audit_entry'}"))
    with database.writing("test") as session:
        for entry in session.query(AuditEntry):
            if entry.subject_type in {"coefficient", "channel_statistics", "extraction"}:
                session.delete(entry)
            known = entry.after.items()
            entry.after = {name: value for name, value in known if name not in BULK}
    report = check_rows(database)
    assert report.faults == []
    assert report.unrecorded > 4


def test_which_of_several_rows_was_changed_is_known(database):
    with database.writing("test") as session:
        organisation = Organisation(name="o")
        session.add(organisation)
        session.flush()
        camera = Camera(organisation_id=organisation.id, make="DJI", model="X", serial="1")
        session.add(camera)
        session.flush()
    with database.engine.begin() as connection:
        connection.execute(
            text(
                "INSERT INTO campaign (id, organisation_id, camera_id, method, created_at) "
                f"VALUES ('cmp_1', '{organisation.id}', '{camera.id}', 'luminance', '2026-01-01 00:00:00')"
            )
        )
    with database.writing("test") as session:
        session.add_all([ChecklistTick(campaign_id="cmp_1", key=key) for key in "ab"])
    with database.writing("test") as session:
        tick = session.get_one(ChecklistTick, ("cmp_1", "a"))
        tick.done_by, tick.done_at = "x", utc_now()
    assert [fault for fault in check_rows(database).faults if "tick" in fault] == []
    tamper(database, "UPDATE checklist_tick SET note = 'n' WHERE key = 'b'")
    (fault,) = [fault for fault in check_rows(database).faults if "tick" in fault]
    assert "note is 'n'" in fault
