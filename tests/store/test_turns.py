"""Messages are sent in turn by organisation: nobody starves, however much others bring."""

import random
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from itertools import count

import pytest
from sqlalchemy import insert, update

from store import jobs
from store.jobs import Dependency
from store.jobs.queues import LANES, QUEUES, WINDOW, touch, unsend_lost
from store.tables import Job, Organisation, Turn, utc_now

pytestmark = pytest.mark.either_database

CARD = 10 * WINDOW
_NUMBERS = count()


class Post:
    """A broker and its workers: what is sent waits until the test begins it."""

    def __init__(self, database):
        self.database = database
        self.waiting = []

    def send(self, messages):
        self.waiting += messages

    def begin(self, queue="frames"):
        """Begin the job of the first message; None without one."""
        message = next((each for each in self.waiting if each.lane.queue == queue), None)
        if message is None:
            return None
        self.waiting.remove(message)
        with self.database.writing("test") as session:
            return jobs.begin(session, message.task_id, lease_s=30.0)


@pytest.fixture
def post(database):
    database.post = Post(database)
    yield database.post
    database.post = None


def organisations(database, number):
    with database.writing("test") as session:
        made = [Organisation(name=f"organisation {each}") for each in range(number)]
        session.add_all(made)
        session.flush()
        return [each.id for each in made]


def add(database, organisation_id, *, times=1, lane="extract", **values):
    row = {"organisation_id": organisation_id, "lane": lane, "created_by": "test"} | values
    row["kind"] = {"fit": "fit", "measure": "measure", "flight": "measure"}.get(lane, "extract")
    with database.writing("test") as session:
        session.execute(insert(Job), [row | {"subject_id": f"frm_{next(_NUMBERS)}"} for _ in range(times)])
        touch(session, LANES[lane].queue)


def sweep(database):
    with database.writing("test") as session:
        touch(session)


def test_one_frame_beside_a_card_waits_for_no_more_than_the_window(database, post):
    big, *others = organisations(database, 4)
    add(database, big, times=CARD)
    for other in others:
        add(database, other)
        begun = [post.begin().organisation_id for _ in range(WINDOW + 2)]
        assert other in begun


def test_in_one_round_everybody_is_served(database, post):
    everybody = organisations(database, 12)
    for organisation in everybody:
        add(database, organisation, times=20)
    begun = [post.begin().organisation_id for _ in range(WINDOW + len(everybody))]
    assert sorted(begun[WINDOW:]) == sorted(everybody)


@pytest.mark.both_databases
def test_the_broker_never_has_more_than_the_window(database, post):
    everybody = organisations(database, 8)
    with ThreadPoolExecutor(8) as threads:
        list(threads.map(lambda each: add(database, each, times=CARD), everybody))
    assert len(post.waiting) == WINDOW
    for lane in ("fit", "look", "flight"):
        add(database, everybody[0], times=CARD, lane=lane)
    assert Counter(each.lane.queue for each in post.waiting) == dict.fromkeys(QUEUES, WINDOW)


@pytest.mark.both_databases
def test_whoever_brings_whatever_whenever_nobody_waits_longer_than_a_round(database, post):
    chance = random.Random(1)
    everybody = organisations(database, 10)
    waiting, waited = Counter(), Counter()
    for organisation in everybody[:3]:
        add(database, organisation, times=20)
        waiting[organisation] += 20
    for _ in range(60):
        if chance.random() < 0.4:
            newcomer = chance.choice(everybody)
            add(database, newcomer, lane=chance.choice(["extract", "renewal"]))
            waiting[newcomer] += 1
        active = [each for each in everybody if waiting[each]]
        served = post.begin().organisation_id
        waiting[served] -= 1
        for each in active:
            waited[each] = 0 if each == served else waited[each] + 1
            assert waited[each] <= len(everybody) + WINDOW
    while any(waiting.values()):
        waiting[post.begin().organisation_id] -= 1
    assert post.begin() is None


def test_what_a_person_waits_for_does_not_stand_behind_the_own_card(database, post):
    (organisation,) = organisations(database, 1)
    for lane in ("renewal", "extract", "flight"):
        add(database, organisation, times=CARD, lane=lane)
    for lane in ("look", "measure", "fit"):
        add(database, organisation, lane=lane)
    assert [post.begin(queue).kind for queue in ("looks", "fits")] == ["extract", "fit"]
    lanes = [lane_of(database, post.begin("maps")) for _ in range(WINDOW + 1)]
    assert lanes == [*["flight"] * WINDOW, "measure"]
    lanes = [lane_of(database, post.begin()) for _ in range(WINDOW + 1)]
    assert lanes == [*["renewal"] * WINDOW, "extract"]


def lane_of(database, claim):
    with database.reading() as session:
        return session.get_one(Job, claim.job_id).lane


def test_within_a_lane_the_first_comes_first(database, post):
    (organisation,) = organisations(database, 1)
    for _ in range(2 * WINDOW):
        add(database, organisation)
    subjects = [post.begin().subject_id for _ in range(2 * WINDOW)]
    assert subjects == sorted(subjects, key=lambda each: int(each.removeprefix("frm_")))


def test_a_store_that_is_away_holds_back_only_what_needs_it(database, post):
    one, other = organisations(database, 2)
    add(database, one, waits_for=str(Dependency.BLOBS), due_at=utc_now() + jobs.LONGEST_PAUSE)
    add(database, one, times=CARD)
    add(database, other, lane="fit")
    assert [post.begin("fits").kind, post.waiting] == ["fit", []]
    with database.writing("test") as session:
        assert jobs.resume(session, Dependency.BLOBS) == 1
    assert len(post.waiting) == WINDOW


def test_what_tries_the_store_again_begins_alone(database, post):
    (organisation,) = organisations(database, 1)
    add(database, organisation, waits_for=str(Dependency.BLOBS))
    add(database, organisation, times=CARD)
    assert [post.begin().attempt, post.waiting] == [1, []]


def test_a_thousand_that_are_tried_later_are_in_nobodys_way(database, post):
    one, other = organisations(database, 2)
    add(database, one, times=1000, due_at=utc_now() + jobs.LONGEST_PAUSE / 2)
    add(database, other)
    assert post.begin().organisation_id == other
    assert post.begin() is None


def test_lost_messages_are_sent_again_and_those_that_wait_are_not(database, post):
    (organisation,) = organisations(database, 1)
    add(database, organisation, times=WINDOW + 3)
    sent = [each.task_id for each in post.waiting]

    def look(waiting):
        with database.writing("test") as session:
            unsend_lost(session, {"frames": waiting})
            touch(session)

    look(0)
    assert [each.task_id for each in post.waiting] == sent, "they may still be on their way"
    with database.writing("test") as session:
        session.execute(update(Job).where(Job.id.in_(sent)).values(sent_at=utc_now() - jobs.LONGEST_PAUSE))
    look(WINDOW)
    assert [each.task_id for each in post.waiting] == sent
    post.waiting.clear()
    look(WINDOW - 1)
    assert [each.task_id for each in post.waiting] == sent
    assert [post.begin().job_id for _ in range(WINDOW)] == sent


@pytest.mark.both_databases
def test_a_turn_that_another_holds_is_waited_for(database, post):
    """On PostgreSQL two senders would else choose the same jobs; SQLite has one writer anyway."""
    (organisation,) = organisations(database, 1)
    with ThreadPoolExecutor(1) as threads:
        with database.writing("test") as session:
            session.get_one(Turn, "frames", with_for_update=True)
            coming = threads.submit(add, database, organisation, times=2 * WINDOW)
            assert not coming.done()
        coming.result()
    assert len({each.task_id for each in post.waiting}) == WINDOW
