"""Heartbeats: who runs, whose work goes on, and who is forgotten."""

from datetime import timedelta

import pytest
from sqlalchemy import func, select, update

from store.jobs.processes import BEAT_EVERY_S, Presence, list_parts
from store.tables import AuditEntry, PartRow, utc_now


def parts(database):
    with database.reading() as session:
        return list_parts(session)


def age(database, **ages_s):
    changes = {name: utc_now() - timedelta(seconds=age_s) for name, age_s in ages_s.items()}
    with database.writing("test") as session:
        session.execute(update(PartRow).values(changes))


def test_a_beat_says_who_works_and_writes_no_audit_entry(database):
    Presence(database, "worker", threads=2).beat()
    (part,) = parts(database)
    assert (part.kind, part.state, part.details) == ("worker", "working", {"threads": 2})
    assert part.pid > 0
    with database.reading() as session:
        assert session.scalar(select(func.count()).select_from(AuditEntry)) == 0


def test_a_loop_that_turns_quickly_writes_seldom_unless_there_is_news(database):
    presence = Presence(database, "worker")
    presence.beat()
    age(database, seen_at=5.0)
    presence.beat()
    assert parts(database)[0].seen_s_ago >= 5.0
    presence.note(sandbox="full")
    presence.beat()
    assert parts(database)[0].seen_s_ago < BEAT_EVERY_S / 2
    assert parts(database)[0].details == {"sandbox": "full"}
    assert len(parts(database)) == 1


def test_a_part_hangs_when_it_beats_and_its_work_does_not_go_on(database):
    """Times from the future were written before the clock was set back."""
    Presence(database, "worker").beat(worked_s_ago=50.0)
    (part,) = parts(database)
    assert 50 <= part.worked_s_ago < 110
    assert part.state == "hung"
    for seen_s, worked_s, state in (
        *((1, 1, "working"), (1, 60, "hung"), (60, 60, "gone")),
        *((-3600, -3600, "gone"), (1, -3600, "hung")),
    ):
        age(database, seen_at=seen_s, worked_at=worked_s)
        assert [part.state for part in parts(database)] == [state], (seen_s, worked_s)


@pytest.mark.parametrize("ago_s", [3600, -3600])
def test_who_is_gone_is_forgotten_and_who_comes_back_is_there_again(database, ago_s):
    presence, other = Presence(database, "service"), Presence(database, "worker")
    presence.beat()
    (known,) = parts(database)
    age(database, seen_at=ago_s)
    other.beat()
    assert [part.kind for part in parts(database)] == ["worker"]
    presence.note()
    presence.beat()
    assert {part.id for part in parts(database)} > {known.id}
    presence.leave()
    assert [part.kind for part in parts(database)] == ["worker"]


def test_a_database_that_does_not_answer_stops_nobody(database):
    presence = Presence(database, "service")
    with database.engine.begin() as connection:
        PartRow.__table__.drop(connection)
    presence.beat()
    presence.leave()


def test_a_slot_is_taken_again_and_the_first_that_works_leads(database):
    first = Presence(database, "worker")
    first.beat()
    second = Presence(database, "worker")
    second.beat()
    with database.reading() as session:
        assert [first.leads(session), second.leads(session)] == [True, False]
    with database.writing("test") as session:
        long_ago = utc_now() - timedelta(seconds=60)
        session.execute(update(PartRow).where(PartRow.id == "worker-1").values(seen_at=long_ago))
    third = Presence(database, "worker")
    third.beat()
    with database.reading() as session:
        assert [each.leads(session) for each in (first, second, third)] == [False, True, False]
    age(database, seen_at=60.0)
    third._due = 0.0
    third.beat()
    # the slot of the first is now the third's
    with database.reading() as session:
        assert [each.leads(session) for each in (first, second, third)] == [False, False, True]
    second._due = 0.0
    second.beat()
    assert {part.id for part in parts(database)} == {"worker-1", "worker-2"}
    # what only seemed to be gone takes another
    first.note()
    first.beat()
    assert {part.id for part in parts(database)} == {"worker-1", "worker-2", "worker-3"}
