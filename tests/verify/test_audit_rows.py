"""A row that was changed in SQL is found, because the trail says otherwise."""

import pytest
from sqlalchemy import text

from store.tables import AuditEntry, Camera, Campaign, ChecklistTick, Organisation, utc_now
from tests.support.campaigns import published_campaign
from tests.support.everything import make_one_of_each
from verify.audit import check_rows, main

pytestmark = pytest.mark.either_database

HELD = ("calibration", "coefficient", "extraction", "channel_statistics", "measurement", "roi")
NEW_METER = (
    "INSERT INTO meter (id, organisation_id, kind, make, model, serial, created_at) "
    "SELECT 'met_x', organisation_id, kind, make, model, 'x', created_at FROM meter WHERE kind = 'luminance'"
)
NEW_COEFFICIENT = (
    "INSERT INTO coefficient SELECT calibration_id, 77, name, value, standard_uncertainty, unit, iso, "
    "f_number, band, channel, model, flags FROM coefficient WHERE position = 0"
)
EDITED = " is not what the trail says: edited"
BULK = {"result_sha256", "inputs_sha256", "header_sha256", "proof_sha256"}


def drop_triggers(database, *names):
    """As the owner of a database can; SQLite has one for changes and one for what goes."""
    with database.engine.begin() as connection:
        for table, name in names:
            if database.is_sqlite or not name.endswith("never_goes"):
                on = "" if database.is_sqlite else f" ON {table}"
                connection.execute(text(f"DROP TRIGGER {table}_{name}{on}"))


@pytest.fixture
def lived_in(house, staged):
    ids = staged(make_one_of_each)
    held = [(table, name) for table in HELD for name in ("never_changes", "never_goes")]
    drop_triggers(house.database, *held, ("publication", "only_closed"))
    return house.database, ids


def tamper(database, statement):
    with database.engine.begin() as connection:
        assert connection.execute(text(statement)).rowcount > 0, statement


def test_what_nobody_touched_stands_as_the_trail_says(lived_in):
    report = check_rows(lived_in[0])
    assert (report.faults, report.unrecorded) == ([], 0)
    assert report.compared > 30


# In rounds, in each of which a table is changed once: the statement, and what is said of its table.
ROUNDS = (
    (
        ("UPDATE reading SET value = value * 1.01", "value is "),
        ("UPDATE coefficient SET standard_uncertainty = 0 WHERE position = 0", f" 0:{EDITED}"),
        ("UPDATE calibration SET version = version + 1", "version is "),
        ("UPDATE channel_statistics SET mean_dn = mean_dn + 0.5 WHERE channel = 'G1'", f" G1:{EDITED}"),
        ("UPDATE measurement SET created_by = 'nobody'", "created_by is "),
        ("UPDATE publication SET valid_from = '2020-01-01 00:00:00'", "valid_from is "),
        ("UPDATE api_key SET scopes = '[\"admin\"]' WHERE id = '{key_id}'", "scopes is "),
        ("UPDATE camera SET pixel_pitch_um = 3.3", "pixel_pitch_um is "),
        ("UPDATE frame SET role = 'field' WHERE role <> 'field'", "role is "),
        ("UPDATE extraction SET extractor = 'other'", "extractor is "),
        ("UPDATE panel SET bands = '[]'", "bands is "),
        ("UPDATE meter SET certificate_due_on = '2099-01-01'", "due_on is "),
    ),
    (
        ("UPDATE reading SET withdrawn_at = created_at WHERE id = '{reading_id}'", "withdrawn_at is "),
        ("UPDATE coefficient SET value = value * 1.01", f" 1:{EDITED}"),
        ("UPDATE calibration SET result = '{{}}'", f" result{EDITED}"),
        ("UPDATE measurement SET result = '{{}}'", f" result{EDITED}"),
        ("UPDATE api_key SET expires_at = '2099-01-01 00:00:00' WHERE id = '{key_id}'", "expires_at is "),
        ("UPDATE frame SET header = '{{}}'", f" header{EDITED}"),
        (NEW_METER, "met_x: has no entry: inserted without one"),
    ),
    (
        ("DELETE FROM reading WHERE id = '{reading_id}'", "is missing: deleted without an entry"),
        (NEW_COEFFICIENT, " 77: has no entry: inserted without one"),
        (f"UPDATE api_key SET sha256 = '{'1' * 64}' WHERE id = '{{key_id}}'", "sha256 is not what the trail"),
    ),
    (("DELETE FROM coefficient WHERE position = 0", " 0: is missing: deleted"),),
)


def test_what_was_changed_in_sql_is_named(lived_in):
    database, ids = lived_in
    known = set()
    for changes in ROUNDS:
        expected = {}
        for statement, said in changes:
            tamper(database, statement.format_map(ids))
            expected[statement.split()[2 if statement.startswith(("DELETE", "INSERT")) else 1]] = said
        faults = set(check_rows(database).faults)
        new = faults - known
        assert {fault.partition(" ")[0] for fault in new} == expected.keys()
        for table, said in expected.items():
            assert any(fault.startswith(f"{table} ") and said in fault for fault in new), (table, new)
        known = faults


def test_the_command_names_a_change_and_fails(lived_in, monkeypatch, capsys):
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
    drop_triggers(database, ("audit_entry", "never_changes"), ("audit_entry", "never_goes"))
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
        session.add(Organisation(id="org_1", name="o"))
        session.flush()
        session.add(Camera(id="cam_1", organisation_id="org_1", make="DJI", model="X", serial="1"))
        session.flush()
        session.add(Campaign(id="cmp_1", organisation_id="org_1", camera_id="cam_1", method="luminance"))
        session.flush()
        session.add_all([ChecklistTick(campaign_id="cmp_1", key=key) for key in "ab"])
    with database.writing("test") as session:
        tick = session.get_one(ChecklistTick, ("cmp_1", "a"))
        tick.done_by, tick.done_at = "x", utc_now()
    assert check_rows(database).faults == []
    tamper(database, "UPDATE checklist_tick SET note = 'n' WHERE key = 'b'")
    (fault,) = check_rows(database).faults
    assert "note is 'n'" in fault
