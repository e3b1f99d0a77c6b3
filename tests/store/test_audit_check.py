"""The audit trail tells when somebody has tampered with it, and where."""

from concurrent.futures import ThreadPoolExecutor

import pytest
from alembic import command
from sqlalchemy import select, text

from store import audit_check
from store.audit import digest
from store.audit_check import Head, check_audit, main
from store.database import OTHER_SCHEMA_EXIT
from store.migrate import alembic_config, migrate
from store.tables import AuditChain, AuditEntry, Organisation


@pytest.fixture
def trail(database, monkeypatch):
    """Six entries in pages of two, on a database whose owner has taken the triggers away."""
    monkeypatch.setattr(audit_check, "_PAGE", 2)
    add(database, *"abcdef")
    with database.engine.begin() as connection:
        if database.is_sqlite:
            connection.execute(text("DROP TRIGGER audit_entry_never_changes"))
            connection.execute(text("DROP TRIGGER audit_entry_never_goes"))
        else:
            connection.execute(text("DROP TRIGGER audit_entry_never_changes ON audit_entry"))
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
        columns = AuditEntry.__table__
        rows = connection.execute(columns.select().order_by(columns.c.seq)).mappings().all()
        previous = "0" * 64
        for row in map(dict, rows):
            if row["seq"] >= first:
                row["previous_sha256"] = previous
                row["sha256"] = digest(row)
                connection.execute(columns.update().where(columns.c.seq == row["seq"]).values(**row))
            previous = row["sha256"]
        chain = AuditChain.__table__
        connection.execute(chain.update().where(chain.c.name == "").values(sha256=previous))


def test_an_untouched_trail_is_whole(trail):
    head, fault = check_audit(trail)
    assert (head.seq, fault) == (6, None)
    with trail.reading() as session:
        assert session.get_one(AuditChain, "").seq == head.seq == head.entries


def test_an_empty_trail_is_whole(database):
    assert check_audit(database) == (Head(seq=0, sha256="0" * 64), None)


@pytest.mark.either_database
@pytest.mark.parametrize(
    ("seq", "change"),
    [
        (1, "actor = 'nobody'"),
        (2, "organisation_id = 'org_x'"),
        (3, "action = 'organisation.delete'"),
        (4, "subject_id = 'x'"),
        (5, "at = '2020-01-01 00:00:00.000000'"),
        (6, """after = '{"name": "z"}'"""),
        (6, "after = '{}', sha256 = '" + "1" * 64 + "'"),
    ],
)
def test_an_edited_entry_is_named(trail, seq, change):
    tamper(trail, f"UPDATE audit_entry SET {change} WHERE seq = {seq}")
    assert fault_of(trail) == (
        seq,
        f"entry {seq} does not have its hash: its content was edited, or it was moved",
    )


@pytest.mark.either_database
@pytest.mark.parametrize("first", [1, 3, 5])
def test_deleted_entries_are_named(trail, first):
    tamper(trail, f"DELETE FROM audit_entry WHERE seq BETWEEN {first} AND 4 OR seq = {first}")
    after = max(first, 4) + 1
    seq, what = fault_of(trail)
    assert seq == after
    assert f"entry {after} does not continue entry {first - 1}" in what
    assert "deleted" in what


@pytest.mark.either_database
@pytest.mark.parametrize("first", [1, 5, 6])
def test_a_deleted_end_is_named(trail, first):
    tamper(trail, f"DELETE FROM audit_entry WHERE seq >= {first}")
    assert fault_of(trail) == (
        first,
        ("entry 6 is" if first == 6 else f"entries {first} to 6 are") + " missing: deleted at the end",
    )


@pytest.mark.either_database
def test_a_deleted_end_with_the_head_set_back_is_seen_by_the_noted_head(trail):
    noted, _ = check_audit(trail)
    tamper(
        trail,
        "DELETE FROM audit_entry WHERE seq = 6",
        "UPDATE audit_chain SET (seq, sha256) = (SELECT seq, sha256 FROM audit_entry WHERE seq = 5) "
        "WHERE name = ''",
    )
    assert fault_of(trail) is None
    assert fault_of(trail, noted) == (6, "the trail ends at entry 5, the noted head was entry 6: cut off")


def moved(*places):
    """Statements that give entries other places, one after the other."""
    return [f"UPDATE audit_entry SET seq = {new} WHERE seq = {old}" for old, new in places]


COPY = (
    "INSERT INTO audit_entry SELECT 4, organisation_id, at, actor, action, subject_type, subject_id, "
    "before, after, previous_sha256, sha256 FROM audit_entry WHERE seq = 3"
)


@pytest.mark.either_database
@pytest.mark.parametrize(
    ("statements", "found_at"),
    [
        (["DELETE FROM audit_entry WHERE seq = 3", *moved((4, 3), (5, 4), (6, 5))], 3),
        ([*moved((6, 7), (5, 6), (4, 5)), COPY, "UPDATE audit_chain SET seq = 7 WHERE name = ''"], 4),
        (moved((3, 9), (4, 3), (9, 4)), 3),
    ],
    ids=["gap closed", "inserted", "changed places"],
)
def test_an_entry_in_anothers_place_is_named(trail, statements, found_at):
    tamper(trail, *statements)
    seq, what = fault_of(trail)
    assert (seq, "it was moved" in what) == (found_at, True)


@pytest.mark.either_database
def test_an_entry_inserted_at_the_end_is_named(trail):
    tamper(
        trail,
        "INSERT INTO audit_entry SELECT 7, organisation_id, at, actor, action, subject_type, subject_id, "
        "before, after, sha256, sha256 FROM audit_entry WHERE seq = 6",
    )
    assert fault_of(trail)[0] == 7
    rehash(trail, 7)
    tamper(
        trail,
        "UPDATE audit_chain SET sha256 = (SELECT sha256 FROM audit_entry WHERE seq = 6) WHERE name = ''",
    )
    assert fault_of(trail) == (7, "entry 7 lies beyond the head: inserted at the end")


@pytest.mark.either_database
def test_an_entry_that_was_hashed_anew_breaks_the_next(trail):
    with trail.reading() as session:
        entry = dict(
            session.execute(AuditEntry.__table__.select().where(AuditEntry.seq == 4)).mappings().one()
        )
    entry["actor"] = "nobody"
    tamper(trail, f"UPDATE audit_entry SET actor = 'nobody', sha256 = '{digest(entry)}' WHERE seq = 4")
    seq, what = fault_of(trail)
    assert seq == 5
    assert "entry 5 does not continue entry 4" in what


@pytest.mark.either_database
def test_only_a_noted_head_catches_who_hashes_everything_anew(trail):
    noted, _ = check_audit(trail)
    add(trail, "later")
    assert fault_of(trail, noted) is None
    tamper(trail, "UPDATE audit_entry SET actor = 'nobody' WHERE seq = 2")
    rehash(trail, 2)
    assert fault_of(trail) is None
    seq, what = fault_of(trail, noted)
    assert seq == 6
    assert "was rewritten" in what


@pytest.mark.either_database
def test_a_head_that_is_missing_or_other_is_named(trail):
    for table in ("audit_chain", "audit_head"):
        tamper(trail, f"UPDATE {table} SET sha256 = '" + "1" * 64 + "'")
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


def rehash_alone(database, seq):
    columns = AuditEntry.__table__
    with database.engine.begin() as connection:
        entry = connection.execute(columns.select().where(columns.c.seq == seq)).mappings().one()
        connection.execute(columns.update().where(columns.c.seq == seq).values(sha256=digest(entry)))


@pytest.mark.either_database
@pytest.mark.parametrize(
    ("statement", "rehashed", "found_at"),
    [
        ("UPDATE audit_entry SET actor = 'x' WHERE seq = 9", None, 9),
        ("UPDATE audit_entry SET actor = 'x' WHERE seq = 9", 9, 11),
        ("UPDATE audit_entry SET actor = 'x' WHERE seq = 11", 11, 11),
        ("UPDATE audit_entry SET organisation_id = :other WHERE seq = 9", 9, 9),
        ("UPDATE audit_entry SET organisation_id = :other WHERE seq = 11", 11, 11),
        ("UPDATE audit_entry SET organisation_id = NULL WHERE seq = 7", 7, 7),
        ("DELETE FROM audit_entry WHERE seq = 9", None, 11),
        ("DELETE FROM audit_entry WHERE seq = 11", None, 10),
        ("DELETE FROM audit_entry WHERE organisation_id = :one", None, 1),
        ("DELETE FROM audit_chain WHERE name = :one", None, 12),
        ("UPDATE audit_chain SET seq = 9 WHERE name = :one", None, 11),
        ("UPDATE audit_entry SET seq = 13 WHERE seq = 9", 13, 11),
    ],
)
def test_the_chain_of_each_organisation_tells(two, statement, rehashed, found_at):
    trail, one, other = two
    given = {name: value for name, value in (("one", one), ("other", other)) if f":{name}" in statement}
    with trail.engine.begin() as connection:
        connection.execute(text(statement), given)
    if rehashed:
        rehash_alone(trail, rehashed)
    seq, what = fault_of(trail)
    assert seq == found_at, what


@pytest.mark.either_database
def test_a_chain_that_vanished_with_its_head_is_missed(two):
    trail, one, _ = two
    tamper(
        trail,
        f"DELETE FROM audit_entry WHERE organisation_id = '{one}'",
        f"DELETE FROM audit_chain WHERE name = '{one}'",
    )
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
    tamper(trail, "DELETE FROM audit_entry WHERE seq = 3")
    assert fault_of(trail) == (3, "entry 3 is missing: deleted, or moved elsewhere")


def test_content_that_cannot_even_be_read_is_named(trail):
    if not trail.is_sqlite:
        pytest.skip("PostgreSQL keeps no text in a JSON column that is none")
    tamper(trail, "UPDATE audit_entry SET after = 'no JSON' WHERE seq = 4")
    assert fault_of(trail)[0] == 4


def test_fifty_who_write_at_once_leave_a_whole_trail(database):
    with ThreadPoolExecutor(50) as threads:
        list(threads.map(lambda number: add(database, f"organisation {number}"), range(50)))
    head, fault = check_audit(database)
    assert (head.seq, fault) == (50, None)


@pytest.fixture
def run(trail, monkeypatch, capsys):
    url = trail.url.render_as_string(hide_password=False)
    monkeypatch.setenv("STILB_DATABASE_URL", url)

    def call(*arguments):
        code = main(list(arguments))
        said = capsys.readouterr()
        return code, said.out + said.err

    return call


def test_the_command_says_the_head_and_compares_it(run, trail):
    code, said = run()
    assert code == 0
    assert "whole: 6 entries" in said
    head = next(line for line in said.splitlines() if line.startswith("head ")).removeprefix("head ")
    assert run(head)[0] == 0
    code, said = run("6:" + "1" * 64)
    assert (code, "broken at entry 6" in said) == (1, True)
    tamper(trail, "DELETE FROM audit_entry WHERE seq = 2")
    code, said = run(head)
    assert (code, "broken at entry 3" in said) == (1, True)
    tamper(trail, "UPDATE alembic_version SET version_num = '9999'")
    code, said = run(head)
    assert (code, "schema 9999, which is newer than this stilb" in said) == (OTHER_SCHEMA_EXIT, True)


def test_a_head_that_is_none_is_refused(run):
    with pytest.raises(SystemExit):
        run("6")


def test_where_no_database_is_none_is_made(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("STILB_DATA", str(tmp_path))
    monkeypatch.delenv("STILB_DATABASE_URL", raising=False)
    assert main([]) == 1
    assert "there is no database" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_names_of_any_script_keep_their_hash(database):
    add(database, 'Gemeinde Grünau \N{SNOWMAN} \\ " \U0001f4f7')
    assert fault_of(database) is None
