"""The audit trail tells when somebody has tampered with it, and where."""

from concurrent.futures import ThreadPoolExecutor

import pytest
from alembic import command
from sqlalchemy import select, text

from store import audit_check
from store.audit import digest
from store.audit_check import Head, check_audit
from store.database import OTHER_SCHEMA_EXIT
from store.migrate import alembic_config, migrate
from store.tables import AuditChain, AuditEntry, Organisation
from verify.audit import main

ENTRIES, CHAINS = AuditEntry.__table__, AuditChain.__table__


@pytest.fixture(autouse=True)
def _pages_of_two(monkeypatch):
    monkeypatch.setattr(audit_check, "_PAGE", 2)


@pytest.fixture
def trail(database):
    """Six entries, on a database whose owner has taken the triggers away."""
    add(database, *"abcdef")
    if database.is_sqlite:
        tamper(database, "DROP TRIGGER audit_entry_never_changes", "DROP TRIGGER audit_entry_never_goes")
    else:
        tamper(database, "DROP TRIGGER audit_entry_never_changes ON audit_entry")
    return database


def add(database, *names):
    for name in names:
        with database.writing("test") as session:
            session.add(Organisation(name=name))


def tamper(database, *statements):
    with database.engine.begin() as connection:
        for statement in statements:
            connection.execute(text(statement))


def fault_of(database, noted=None):
    _, fault = check_audit(database, noted)
    return (fault.seq, fault.what) if fault else None


def rehash(database, first):
    """What an attacker who can rewrite everything would do: compute every hash from an entry on anew."""
    with database.engine.begin() as connection:
        previous = "0" * 64
        rows = connection.execute(ENTRIES.select().order_by(ENTRIES.c.seq)).mappings().all()
        for row in map(dict, rows):
            if row["seq"] >= first:
                row["previous_sha256"] = previous
                row["sha256"] = digest(row)
                connection.execute(ENTRIES.update().where(ENTRIES.c.seq == row["seq"]).values(**row))
            previous = row["sha256"]
        connection.execute(CHAINS.update().where(CHAINS.c.name == "").values(sha256=previous))


def rehash_alone(database, seq):
    one = ENTRIES.c.seq == seq
    with database.engine.begin() as connection:
        entry = connection.execute(ENTRIES.select().where(one)).mappings().one()
        connection.execute(ENTRIES.update().where(one).values(sha256=digest(entry)))


def test_an_untouched_trail_is_whole(database):
    assert check_audit(database) == (Head(seq=0, sha256="0" * 64), None)
    add(database, *"abcde", 'Gemeinde Grünau \N{SNOWMAN} \\ " \U0001f4f7')
    head, fault = check_audit(database)
    assert (head.seq, fault) == (6, None)
    with database.reading() as session:
        assert session.get_one(AuditChain, "").seq == head.seq == head.entries


def change(seq, changes):
    return f"UPDATE audit_entry SET {changes} WHERE seq = {seq}"


def delete(where):
    return f"DELETE FROM audit_entry WHERE {where}"


def move(*places):
    """Statements that give entries other places, one after the other."""
    return [change(old, f"seq = {new}") for old, new in places]


def copy(source, target, previous="previous_sha256"):
    return (
        f"INSERT INTO audit_entry SELECT {target}, organisation_id, at, actor, action, subject_type, "
        f"subject_id, before, after, {previous}, sha256 FROM audit_entry WHERE seq = {source}"
    )


EDITED = "does not have its hash: its content was edited, or it was moved"
GONE = "one of them was rewritten, inserted or moved, or one between them was deleted"
ONE_MORE = "UPDATE audit_chain SET seq = 7 WHERE name = ''"


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
@pytest.mark.parametrize(
    ("statements", "found_at", "said"),
    [
        ([change(1, "actor = 'nobody'")], 1, f"entry 1 {EDITED}"),
        ([change(2, "organisation_id = 'org_x'")], 2, f"entry 2 {EDITED}"),
        ([change(3, "action = 'organisation.delete'")], 3, f"entry 3 {EDITED}"),
        ([change(4, "subject_id = 'x'")], 4, f"entry 4 {EDITED}"),
        ([change(5, "at = '2020-01-01 00:00:00.000000'")], 5, f"entry 5 {EDITED}"),
        ([change(6, """after = '{"name": "z"}'""")], 6, f"entry 6 {EDITED}"),
        ([change(6, f"after = '{{}}', sha256 = '{'1' * 64}'")], 6, f"entry 6 {EDITED}"),
        ([delete("seq <= 4")], 5, f"entry 5 does not continue entry 0: {GONE}"),
        ([delete("seq IN (3, 4)")], 5, f"entry 5 does not continue entry 2: {GONE}"),
        ([delete("seq = 5")], 6, f"entry 6 does not continue entry 4: {GONE}"),
        ([delete("seq >= 1")], 1, "entries 1 to 6 are missing: deleted at the end"),
        ([delete("seq >= 5")], 5, "entries 5 to 6 are missing: deleted at the end"),
        ([delete("seq = 6")], 6, "entry 6 is missing: deleted at the end"),
        ([delete("seq = 3"), *move((4, 3), (5, 4), (6, 5))], 3, "it was moved"),
        ([*move((6, 7), (5, 6), (4, 5)), copy(3, 4), ONE_MORE], 4, "it was moved"),
        (move((3, 9), (4, 3), (9, 4)), 3, "it was moved"),
    ],
)
def test_what_was_edited_deleted_or_moved_is_named(trail, statements, found_at, said):
    tamper(trail, *statements)
    seq, what = fault_of(trail)
    assert (seq, said in what) == (found_at, True), what


@pytest.mark.either_database
def test_a_deleted_end_with_the_head_set_back_is_seen_by_the_noted_head(trail):
    noted, _ = check_audit(trail)
    last = "SELECT seq, sha256 FROM audit_entry WHERE seq = 5"
    tamper(trail, delete("seq = 6"), f"UPDATE audit_chain SET (seq, sha256) = ({last}) WHERE name = ''")
    assert fault_of(trail) is None
    assert fault_of(trail, noted) == (6, "the trail ends at entry 5, the noted head was entry 6: cut off")


@pytest.mark.either_database
def test_an_entry_inserted_at_the_end_is_named(trail):
    tamper(trail, copy(6, 7, previous="sha256"))
    assert fault_of(trail)[0] == 7
    rehash(trail, 7)
    last = "SELECT sha256 FROM audit_entry WHERE seq = 6"
    tamper(trail, f"UPDATE audit_chain SET sha256 = ({last}) WHERE name = ''")
    assert fault_of(trail) == (7, "entry 7 lies beyond the head: inserted at the end")


@pytest.mark.either_database
def test_an_entry_that_was_hashed_anew_breaks_the_next(trail):
    tamper(trail, change(4, "actor = 'nobody'"))
    rehash_alone(trail, 4)
    seq, what = fault_of(trail)
    assert (seq, "entry 5 does not continue entry 4" in what) == (5, True)


@pytest.mark.either_database
def test_only_a_noted_head_catches_who_hashes_everything_anew(trail):
    noted, _ = check_audit(trail)
    add(trail, "later")
    assert fault_of(trail, noted) is None
    tamper(trail, change(2, "actor = 'nobody'"))
    rehash(trail, 2)
    assert fault_of(trail) is None
    seq, what = fault_of(trail, noted)
    assert (seq, "was rewritten" in what) == (6, True)


@pytest.mark.either_database
def test_a_head_that_is_missing_or_other_is_named(trail):
    for table in ("audit_chain", "audit_head"):
        tamper(trail, f"UPDATE {table} SET sha256 = '{'1' * 64}'")
        assert "does not match the head" in fault_of(trail)[1]
        tamper(trail, f"DELETE FROM {table}")
        assert "head's row is missing" in fault_of(trail)[1]


@pytest.fixture
def two(trail):
    """Two organisations that took turns after the six: entries 7, 9, 11 of one and 8, 10, 12 of the other."""
    with trail.reading() as session:
        one, other = session.scalars(select(Organisation.id).order_by(Organisation.id).limit(2))
    for number in range(3):
        for organisation_id in (one, other):
            with trail.writing("test", organisation_id) as session:
                session.get_one(Organisation, organisation_id).name = f"{organisation_id} {number}"
    assert fault_of(trail) is None
    return trail, one, other


@pytest.mark.either_database
@pytest.mark.parametrize(
    ("statement", "rehashed", "found_at"),
    [
        (change(9, "actor = 'x'"), None, 9),
        (change(9, "actor = 'x'"), 9, 11),
        (change(11, "actor = 'x'"), 11, 11),
        (change(9, "organisation_id = '{other}'"), 9, 9),
        (change(11, "organisation_id = '{other}'"), 11, 11),
        (change(7, "organisation_id = NULL"), 7, 7),
        (delete("seq = 9"), None, 11),
        (delete("seq = 11"), None, 10),
        (delete("organisation_id = '{one}'"), None, 1),
        ("DELETE FROM audit_chain WHERE name = '{one}'", None, 12),
        ("UPDATE audit_chain SET seq = 9 WHERE name = '{one}'", None, 11),
        (change(9, "seq = 13"), 13, 11),
    ],
)
def test_the_chain_of_each_organisation_tells(two, statement, rehashed, found_at):
    trail, one, other = two
    tamper(trail, statement.format(one=one, other=other))
    if rehashed:
        rehash_alone(trail, rehashed)
    seq, what = fault_of(trail)
    assert seq == found_at, what


@pytest.mark.either_database
def test_a_chain_that_vanished_with_its_head_is_missed(two):
    trail, one, _ = two
    tamper(trail, delete(f"organisation_id = '{one}'"), f"DELETE FROM audit_chain WHERE name = '{one}'")
    assert f"head's row of {one} is missing" in fault_of(trail)[1]


def test_a_common_chain_goes_on_in_one_of_each_organisation(trail):
    config = alembic_config()
    with trail.engine.connect() as connection, connection.begin():
        config.attributes["connection"] = connection
        command.downgrade(config, "0019")
        last = "(SELECT sha256 FROM audit_entry WHERE seq = 6)"
        connection.execute(text(f"UPDATE audit_head SET seq = 6, sha256 = {last}"))
        noted = Head(seq=6, sha256=connection.scalar(text(f"SELECT {last}")))
    migrate(trail)
    assert check_audit(trail, noted) == (noted, None)
    with trail.reading() as session:
        organisation_id = session.scalars(select(Organisation.id).limit(1)).one()
    for owner in (organisation_id, None, organisation_id):
        with trail.writing("test", owner) as session:
            session.get_one(Organisation, organisation_id).name += "x"
    head, fault = check_audit(trail, noted)
    assert (head.seq, head.entries, fault) == (9, 9, None)
    assert check_audit(trail, head) == (head, None)
    tamper(trail, delete("seq = 3"))
    assert fault_of(trail) == (3, "entry 3 is missing: deleted, or moved elsewhere")


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
def test_content_that_cannot_even_be_read_is_named(trail):
    """PostgreSQL keeps no text in a JSON column that is none."""
    tamper(trail, change(4, "after = 'no JSON'"))
    assert fault_of(trail)[0] == 4


def test_fifty_who_write_at_once_leave_a_whole_trail(database):
    with ThreadPoolExecutor(50) as threads:
        list(threads.map(lambda number: add(database, f"organisation {number}"), range(50)))
    head, fault = check_audit(database)
    assert (head.seq, fault) == (50, None)


@pytest.mark.either_database
def test_the_command_says_the_head_and_compares_it(trail, monkeypatch, capsys):
    monkeypatch.setenv("STILB_DATABASE_URL", trail.url.render_as_string(hide_password=False))

    def run(*arguments):
        code = main(list(arguments))
        return code, "".join(capsys.readouterr())

    code, said = run()
    assert (code, "whole: 6 entries" in said) == (0, True)
    head = next(line for line in said.splitlines() if line.startswith("head ")).removeprefix("head ")
    assert run(head)[0] == 0
    code, said = run("6:" + "1" * 64)
    assert (code, "broken at entry 6" in said) == (1, True)
    with pytest.raises(SystemExit):
        run("6")
    tamper(trail, delete("seq = 2"))
    code, said = run(head)
    assert (code, "broken at entry 3" in said) == (1, True)
    tamper(trail, "UPDATE alembic_version SET version_num = '9999'")
    code, said = run(head)
    assert (code, "schema 9999, which is newer than this stilb" in said) == (OTHER_SCHEMA_EXIT, True)


def test_where_no_database_is_none_is_made(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("STILB_DATA", str(tmp_path))
    monkeypatch.delenv("STILB_DATABASE_URL", raising=False)
    assert main([]) == 1
    assert "there is no database" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
