"""Claims go round the organisations, and the lanes of each: nobody starves, however much others bring."""

import random
from collections import Counter
from itertools import count

from sqlalchemy import insert

from store import jobs
from store.columns import utc_now
from store.jobs import Dependency, Turn
from store.tables import Job, Organisation

CARD = 300
_NUMBERS = count()


def organisations(database, number):
    with database.writing("test") as session:
        made = [Organisation(name=f"organisation {each}") for each in range(number)]
        session.add_all(made)
        session.flush()
        return [each.id for each in made]


def add(database, organisation_id, *, times=1, kind="extract", lane=None):
    rows = [
        {
            "organisation_id": organisation_id,
            "kind": kind,
            "lane": lane or kind,
            "subject_id": f"frm_{next(_NUMBERS)}",
            "created_by": "test",
        }
        for _ in range(times)
    ]
    with database.writing("test") as session:
        session.execute(insert(Job), rows)


def claim(database, turn, *, without=()):
    with database.writing("test") as session:
        return jobs.claim_next(session, turn, lease_s=30.0, without=without)


def test_one_frame_beside_a_card_is_the_next_but_one_at_most(database):
    big, *others = organisations(database, 7)
    add(database, big, times=CARD)
    turn = Turn()
    for other in others:
        claim(database, turn)
        add(database, other)
        served = [claim(database, turn).organisation_id for _ in range(2)]
        assert other in served


def test_a_worker_that_starts_in_the_middle_serves_everybody_in_one_round(database):
    everybody = organisations(database, 12)
    for organisation in everybody:
        add(database, organisation, times=20)
    served = [claim(database, turn).organisation_id for turn in [Turn()] for _ in everybody]
    assert sorted(served) == sorted(everybody)


def test_whoever_brings_whatever_whenever_nobody_waits_longer_than_a_round(database):
    """Three workers, each with a turn of its own, and jobs that come while they claim."""
    chance = random.Random(1)
    everybody = organisations(database, 20)
    turns = [Turn() for _ in range(3)]
    waiting, waited = Counter(), Counter()
    for organisation in everybody[:3]:
        add(database, organisation, times=40)
        waiting[organisation] += 40
    for _ in range(100):
        if chance.random() < 0.4:
            newcomer = chance.choice(everybody)
            lane = chance.choice(["extract", "look", "flight"])
            add(database, newcomer, lane=lane)
            waiting[newcomer] += 1
        active = [each for each in everybody if waiting[each]]
        served = claim(database, chance.choice(turns)).organisation_id
        waiting[served] -= 1
        for each in active:
            waited[each] = 0 if each == served else waited[each] + 1
            # each worker passes an organisation once a round; three that pass it in turn are three rounds
            assert waited[each] <= len(turns) * len(everybody)
    while any(waiting.values()):
        waiting[claim(database, turns[0]).organisation_id] -= 1
    assert claim(database, turns[0]) is None


def test_what_a_person_waits_for_does_not_stand_behind_the_own_card(database):
    (organisation,) = organisations(database, 1)
    add(database, organisation, times=CARD)
    add(database, organisation, times=CARD, kind="measure", lane="flight")
    turn = Turn()
    claim(database, turn)
    asked = {"fit": "fit", "measure": "measure", "look": "extract"}
    for lane, kind in asked.items():
        add(database, organisation, kind=kind, lane=lane)
    begun = [claim(database, turn) for _ in range(5)]
    assert {("fit", "fit"), ("measure", "measure"), ("extract", "look")} <= {
        (each.kind, lane_of(database, each)) for each in begun
    }


def lane_of(database, claimed):
    with database.reading() as session:
        return session.get_one(Job, claimed.job_id).lane


def test_within_a_lane_the_first_comes_first(database):
    (organisation,) = organisations(database, 1)
    turn = Turn()
    for _ in range(5):
        add(database, organisation)
    subjects = [claim(database, turn).subject_id for _ in range(5)]
    assert subjects == sorted(subjects, key=lambda each: int(each.removeprefix("frm_")))


def test_what_does_not_serve_holds_back_only_what_needs_it(database):
    one, other = organisations(database, 2)
    add(database, one, times=CARD)
    add(database, other, kind="fit")
    turn = Turn()
    assert claim(database, turn, without=["extract", "measure"]).kind == "fit"
    assert claim(database, turn, without=["extract", "measure"]) is None
    assert claim(database, turn).organisation_id == one


def test_a_thousand_that_wait_for_something_else_are_in_nobodys_way(database):
    one, other = organisations(database, 2)
    with database.writing("test") as session:
        session.execute(
            insert(Job),
            [
                {
                    "organisation_id": one,
                    "kind": "extract",
                    "lane": "extract",
                    "subject_id": f"frm_{number}",
                    "created_by": "test",
                    "waits_for": str(Dependency.BLOBS),
                    "due_at": utc_now() + jobs.LONGEST_PAUSE / 2,
                }
                for number in range(1000)
            ],
        )
    add(database, other)
    turn = Turn()
    assert claim(database, turn).organisation_id == other
    assert claim(database, turn) is None
