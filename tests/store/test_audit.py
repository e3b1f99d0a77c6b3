"""Every change leaves who, when, what, before and after; secrets leave nothing."""

from contextlib import suppress

from sqlalchemy import select
from sqlalchemy.exc import IntegrityError

from store.queries.organisations import create_key
from store.tables import AuditEntry, Camera, Organisation


def entries(database, subject_id):
    with database.reading() as session:
        return list(session.scalars(select(AuditEntry).where(AuditEntry.subject_id == subject_id)))


def test_create_change_and_delete(database):
    with database.writing("key_1") as session:
        organisation = Organisation(name="house")
        session.add(organisation)
        session.flush()
        camera = Camera(organisation_id=organisation.id, make="DJI", model="X", serial="1")
        session.add(camera)
    with database.writing("key_2", organisation.id) as session:
        session.get_one(Camera, camera.id).note = "dropped once"
    with database.writing("key_3") as session:
        session.delete(session.get_one(Camera, camera.id))
    created, changed, deleted = entries(database, camera.id)
    told = [(e.actor, e.action.removeprefix("camera.")) for e in (created, changed, deleted)]
    assert told == [("key_1", "create"), ("key_2", "change"), ("key_3", "delete")]
    assert (created.before, created.after["serial"]) == ({}, "1")
    assert created.after["created_at"].startswith(str(camera.created_at.year))
    assert (changed.before, changed.after) == ({"note": None}, {"note": "dropped once"})
    assert changed.organisation_id == organisation.id
    assert (deleted.before["note"], deleted.after) == ("dropped once", {})


def test_what_is_rolled_back_was_never_done(database):
    """Of a savepoint that alone: what was done before it stands."""
    undone, done = Organisation(name="undone"), Organisation(name="house")
    for organisation in (undone, done):
        with database.writing("key_1") as session:
            session.add(organisation)
            session.flush()
            with suppress(IntegrityError), session.begin_nested():
                session.add(Organisation(name=organisation.name))
            if organisation is undone:
                session.rollback()
    assert [len(entries(database, each.id)) for each in (undone, done)] == [0, 1]


def test_a_key_is_audited_without_its_hash(database):
    with database.writing("test") as session:
        organisation = Organisation(name="house")
        session.add(organisation)
        session.flush()
        named = {"name": "n", "scopes": ["read"], "secret": "stilb_secret"}
        key = create_key(session, organisation_id=organisation.id, **named)
    (entry,) = entries(database, key.id)
    assert entry.after["scopes"] == ["read"]
    assert key.sha256 not in str(entry.after)
    assert "stilb_secret" not in str(entry.after)
