"""Who publishes at once, or behind the code's back; `test_publications_model.py` walks through the rest."""

from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime

import pytest
from sqlalchemy import select, text
from sqlalchemy.exc import DBAPIError, IntegrityError

from store.database import Conflict
from store.publications import in_force, publish, revoke
from store.queries.calibrations import read_version_statuses
from store.tables import Calibration, Publication, utc_now
from tests.support.versions import add_versions

JAN, MAR, JUN, SEP = (datetime(2026, month, 1, tzinfo=UTC) for month in (1, 3, 6, 9))


def decide(database, version_id, valid_from=None, valid_to=None):
    """Publish, or revoke when no time is given."""
    with database.writing("test") as session:
        version = session.get_one(Calibration, version_id)
        if valid_from is None:
            revoke(session, version, reason="wrong meter", by="test")
        else:
            publish(session, version, valid_from=valid_from, valid_to=valid_to, reason="good")


def held(database, version_id, at):
    """How many versions are in force."""
    with database.reading() as session:
        camera_id = session.get_one(Calibration, version_id).camera_id
        return len(in_force(session, camera_id=camera_id, method="luminance", at=at))


def test_twenty_who_publish_at_once_leave_one_in_force(database):
    versions = add_versions(database, 20)
    with ThreadPoolExecutor(20) as threads:
        list(threads.map(lambda version: decide(database, version, JAN), versions))
    assert held(database, versions[0], MAR) == 1
    with database.reading() as session:
        rows = list(session.scalars(select(Publication)))
        states = read_version_statuses(session, versions).values()
    assert len([row for row in rows if row.known_to is None]) == 1
    assert sorted(each.state for each in states) == ["published"] + ["superseded"] * 19
    # knowledge has one order: each row is closed exactly when the next is opened
    starts = sorted(row.known_from for row in rows)
    assert sorted(row.known_to for row in rows if row.known_to) == starts[1:]


def test_a_version_that_is_revoked_meanwhile_is_not_published(database):
    (version_id,) = add_versions(database, 1)
    decide(database, version_id, MAR)
    with ThreadPoolExecutor(1) as threads:
        with database.writing("test") as session:
            revoke(session, session.get_one(Calibration, version_id), reason="wrong meter", by="test")
            published = threads.submit(decide, database, version_id, JAN)
            # long enough to read all that can be read before the lock
            with pytest.raises(TimeoutError):
                published.result(0.5)
        with pytest.raises(Conflict):
            published.result()
    assert held(database, version_id, MAR) == 0


def test_the_database_itself_refuses_an_overlap(database):
    one, two = add_versions(database, 2)
    decide(database, one, JAN, JUN)
    with database.reading() as session:
        row = session.scalars(select(Publication)).one()
    times = {"valid_from": MAR, "valid_to": SEP, "known_from": utc_now(), "known_to": None}
    reason = "behind the back of publish()"
    overlapping = Publication(slot_id=row.slot_id, calibration_id=two, reason=reason, **times)
    with pytest.raises(IntegrityError, match="ex_publication_overlap"), database.writing("test") as session:
        session.add(overlapping)


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE calibration SET version = 7",
        "DELETE FROM calibration",
        "UPDATE audit_entry SET actor = 'nobody'",
        "DELETE FROM audit_entry",
        "DELETE FROM publication",
        "UPDATE publication SET valid_to = NULL, valid_from = '2020-01-01 00:00:00.000000'",
    ],
)
def test_the_database_itself_refuses_to_rewrite_history(database, statement):
    (one,) = add_versions(database, 1)
    decide(database, one, JAN, JUN)
    with (
        pytest.raises(DBAPIError, match=r"never change|never deleted|only ever closed"),
        database.writing("test") as session,
    ):
        session.execute(text(statement))
