"""Publications against a plain list of what was said, replayed: 500 random steps, and 240 on PostgreSQL.

`make model` takes 10,000 on either.

The model knows nothing of rows, slots or closed knowledge: who holds an instant is whoever was last published
over it, unless that version was revoked since; as known then, only what had been said by then counts. What is
answered is checked too: with a filter, and with the sentence that says why.
"""

import itertools
import json
import os
import random
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from secrets import token_hex

import pytest
from sqlalchemy import select
from starlette.requests import Request

from service.coefficients.routes import Wanted, answer_held
from store import publications
from store.database import Conflict
from store.queries.calibrations import history, read_version_statuses
from store.ready.lookups import Held, select_held
from store.tables import Calibration, Camera, Campaign, CoefficientRow, Organisation, Publication, Revocation
from tests.support.versions import bare_version, find_held

# the decisions are the same code on both; what PostgreSQL does otherwise, it does within a few hundred steps
STEPS = {"sqlite": 500, "postgresql": 240}
if "MODEL_STEPS" in os.environ:
    STEPS = dict.fromkeys(STEPS, int(os.environ["MODEL_STEPS"]))
SEED = 20260501
TICK = timedelta(microseconds=1)
INSTANTS = [datetime(2026, 1, 1, tzinfo=UTC) + timedelta(hours=7 * number) for number in range(24)]
FIRST_CLOCK = datetime(2026, 6, 1, tzinfo=UTC)
ISOS = (100.0, 200.0)
LENSES = ({}, {"lens": {"model": "MFT 15mm"}})


@dataclass(frozen=True)
class Said:
    """One event: ``version`` holds [start, end) from now on; with no start it is revoked."""

    known: datetime
    version: str
    start: datetime | None = None
    end: datetime | None = None


class Model:
    """What was said of each slot, in the order in which it was said."""

    def __init__(self):
        self.said = {}
        self.revoked = set()

    def copy(self):
        twin = Model()
        twin.said = {slot: list(events) for slot, events in self.said.items()}
        twin.revoked = set(self.revoked)
        return twin

    def say(self, slot, event):
        events = self.said.setdefault(slot, [])
        if events:
            assert event.known > events[-1].known, "knowledge has an order"
        events.append(event)
        if event.start is None:
            self.revoked.add(event.version)

    def holder(self, slot, at, known_at):
        holds = None
        for event in self.said.get(slot, []):
            if event.known > known_at:
                break
            if event.start is None:
                holds = None if holds == event.version else holds
            elif event.start <= at and (event.end is None or at < event.end):
                holds = event.version
        return holds

    def published(self, slot):
        return {event.version for event in self.said.get(slot, []) if event.start is not None}

    def hulls(self, slot):
        """From when to when each version that holds anything now does so, gaps included."""
        events = self.said.get(slot, [])
        edges = sorted({edge for event in events for edge in (event.start, event.end) if edge})
        hulls = {}
        for edge, after in itertools.zip_longest(edges, edges[1:]):
            version = self.holder(slot, edge, events[-1].known)
            first, _ = hulls.get(version, (edge, None))
            hulls[version] = first, after
        return hulls


def _dark(version, place):
    given = {"name": "dark_signal_dn", "unit": "DN", "model": "mean", "flags": [], "iso": ISOS[place]}
    return CoefficientRow(
        calibration_id=version.id, position=place, value=1.0, standard_uncertainty=0.1, **given
    )


def _explain(version, row):
    start, end, known = (
        moment and f"{moment:%Y-%m-%dT%H:%M:%SZ}" for moment in (row.valid_from, row.valid_to, row.known_from)
    )
    until = f"to {end}" if end else "on"
    return f"version {version} is in force from {start} {until}, known since {known}: r"


class World:
    """Three cameras, one of them with two lenses, many versions each; and a clock that may jump back."""

    def __init__(self, database, monkeypatch, *, versions):
        self.database = database
        self.now = FIRST_CLOCK
        monkeypatch.setattr(publications, "utc_now", lambda: self.now)
        self.slots = {}
        with database.writing("test") as session:
            organisation = Organisation(name=f"house {token_hex(8)}")
            session.add(organisation)
            session.flush()
            for serial, lenses in (("1", LENSES), ("2", LENSES[:1]), ("3", LENSES[1:])):
                self._add_camera(session, organisation.id, serial, lenses, versions)
        self.model = Model()

    def _add_camera(self, session, organisation_id, serial, lenses, versions):
        camera = Camera(organisation_id=organisation_id, make="DJI", model="FC6520", serial=serial)
        session.add(camera)
        session.flush()
        campaign = Campaign(organisation_id=organisation_id, camera_id=camera.id, method="luminance")
        session.add(campaign)
        session.flush()
        for place, lens in enumerate(lenses):
            rows = [
                bare_version(campaign, 1 + number * len(lenses) + place, configuration=lens)
                for number in range(versions)
            ]
            session.add_all(rows)
            session.flush()
            session.add_all(_dark(row, place) for row in rows for place in range(len(ISOS)))
            session.flush()
            self.slots[camera.id, place if len(lenses) > 1 else LENSES.index(lens)] = [r.id for r in rows]

    def publish(self, session, slot, version, start, end):
        calibration = session.get_one(Calibration, version)
        if version in self.model.revoked:
            with pytest.raises(Conflict):
                publications.publish(session, calibration, valid_from=start, valid_to=end, reason="r")
            return
        row = publications.publish(session, calibration, valid_from=start, valid_to=end, reason="r")
        self._say(slot, Said(row.known_from, version, start, end))

    def revoke(self, session, slot, version):
        again = version in self.model.revoked
        publications.revoke(session, session.get_one(Calibration, version), reason="r", by="test")
        if not again:
            self._say(slot, Said(session.get_one(Revocation, version).revoked_at, version))

    def _say(self, slot, event):
        assert event.known >= self.now
        self.model.say(slot, event)

    def look_up(self, session, camera_id, at, known_at):
        found = find_held(session, camera_id, at, known_at)
        got = {
            (camera_id, LENSES.index(held.calibration.configuration)): held.calibration.id for held in found
        }
        assert len(got) == len(found)
        for known in (known_at, *([None] if known_at > self.now + timedelta(hours=1) else [])):
            asked = {"camera_id": camera_id, "method": "luminance", "at": at, "known_at": known}
            asked["organisation_id"] = session.get_one(Camera, camera_id).organisation_id
            rows = session.execute(select_held(now=known is None, by_key=False), asked)
            ready = [Held(*row) for row in rows]
            assert [held.calibration_id for held in ready] == [held.calibration.id for held in found]
        self._check_answer(ready, found)
        slots = [slot for slot in self.slots if slot[0] == camera_id]
        holders = {slot: self.model.holder(slot, at, known_at) for slot in slots}
        assert got == {slot: version for slot, version in holders.items() if version}

    def _check_answer(self, ready, found):
        iso = ISOS[len(ready) % len(ISOS)]
        plain = Request({"type": "http", "headers": []})
        answer = answer_held(plain, Wanted(method="luminance", iso=iso), ready)
        items = json.loads(answer.body)["items"] if answer else []
        assert [(each["calibration_id"], each["iso"], each["why"]) for each in items] == [
            (held.calibration.id, iso, _explain(held.calibration.version, held.publication)) for held in found
        ]

    def check_states(self, session):
        for slot, versions in self.slots.items():
            now, hulls = read_version_statuses(session, versions), self.model.hulls(slot)
            for version in versions:
                self._check_state(slot, version, now[version], hulls.get(version))
            for state in ("draft", "published", "superseded", "revoked"):
                rows = session.scalars(history(slot[0], method="luminance", state=state))
                listed = {row.id for row in rows} & set(versions)
                assert listed == {version for version in versions if now[version].state == state}

    def _check_state(self, slot, version, status, hull):
        if version in self.model.revoked:
            assert status.state == "revoked"
            assert hull is None
        elif version not in self.model.published(slot):
            assert status.state == "draft"
        else:
            assert status.state in {"published", "superseded"}
            assert status.state == "superseded" or hull
            assert (status.valid_from, status.valid_to) == (hull or (None, None))
            assert (status.superseded_by is None) == (status.state == "published")


def anything_said(world):
    return [event.known for events in world.model.said.values() for event in events] or [FIRST_CLOCK]


class Walk:
    def __init__(self, world, seed):
        self.world, self.random = world, random.Random(seed)

    def step(self, session):
        world, dice = self.world, self.random
        world.now += dice.choice([timedelta(0), TICK, timedelta(seconds=3), timedelta(seconds=-2)])
        slot = dice.choice(list(world.slots))
        known = dice.random()
        if known < 0.15:
            version = dice.choice(world.slots[slot])
            start, end = self._validity()
            world.publish(session, slot, version, start, end)
        elif known < 0.165:
            world.revoke(session, slot, dice.choice(world.slots[slot]))
        else:
            world.look_up(session, slot[0], self._at(), self._known_at())

    def _validity(self):
        start = self.random.choice(INSTANTS)
        if self.random.random() < 0.4:
            return start, None
        later = [instant for instant in INSTANTS if instant > start] or [start + TICK]
        return start, self.random.choice(later)

    def _at(self):
        near = self.random.choice(INSTANTS)
        return near + self.random.choice([-TICK, timedelta(0), timedelta(0), TICK, timedelta(hours=3)])

    def _known_at(self):
        far = [FIRST_CLOCK - timedelta(days=1), self.world.now + timedelta(days=1)]
        near = self.random.choice(anything_said(self.world)[-40:] + anything_said(self.world)[:5])
        return self.random.choice([*far, near - TICK, near, near, near + TICK])


class RolledBack(Exception):  # noqa: N818
    pass


def test_random_steps_agree_with_the_model(database, monkeypatch):
    world = World(database, monkeypatch, versions=60)
    walk = Walk(world, SEED)
    steps_in_all = STEPS["sqlite" if database.is_sqlite else "postgresql"]
    done = 0
    while done < steps_in_all:
        before, steps = world.model.copy(), walk.random.randint(1, 40)
        lost = walk.random.random() < 0.1
        try:
            with database.writing("test") as session:
                for number in range(done, done + steps):
                    step = number
                    walk.step(session)
                if lost:
                    raise RolledBack  # noqa: TRY301
            with database.reading() as session:
                walk.world.look_up(session, next(iter(world.slots))[0], INSTANTS[5], world.now)
                if walk.random.random() < 0.1:
                    world.check_states(session)
        except RolledBack:
            world.model = before
        except (AssertionError, Exception) as error:
            error.add_note(f"seed {SEED}, step {step}")
            raise
        done += steps
    with database.reading() as session:
        world.check_states(session)
        rows = list(session.scalars(select(Publication)))
    assert len(rows) > steps_in_all / 10
    assert len(world.model.revoked) > steps_in_all / 200
