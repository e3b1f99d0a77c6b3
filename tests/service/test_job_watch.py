"""Who waits for a job is told of its end, also when the database was away meanwhile."""

import asyncio
import json
import threading
import time
from pathlib import Path

import pytest
from sqlalchemy import update

from service.http.problems import Problem
from service.jobs.watch import MOST_STREAMS, JobWatch
from store.database import Database
from store.queries.organisations import Who
from store.tables import Job, utc_now
from tests.support.house import House
from tests.support.proxy import Proxy

pytestmark = pytest.mark.either_database


@pytest.fixture
def url(postgres, migrated_postgres):
    url = postgres.new_database(like=migrated_postgres)
    yield url
    postgres.drop_database(url)


async def wait_for(watch, job_id):
    """Wait until it is told; the look that is under way then has a connection until it ends."""
    await watch.wait(job_id, 3600.0)
    await watch._task


@pytest.mark.parametrize("mode", ["away", "silent"])
def test_a_database_that_was_away_delays_nobody_who_waits(mode, url, tmp_path):
    direct = Database(url)
    folder, name = Path(url.partition("?host=")[2]), url.partition("?")[0].rpartition("/")[2]
    with House(direct, tmp_path) as house, Proxy(folder / ".s.PGSQL.5432") as proxy:
        job_id = house.upload(house.campaign(), house.frame_bytes(), role="dark")["job_id"]
        through = Database(f"postgresql+psycopg://stilb@{proxy.address}/{name}", answer_within_s=0.5)

        def outage():
            time.sleep(0.3)
            proxy.become(mode)
            time.sleep(1.0)
            with direct.writing("test") as session:
                ended = update(Job).where(Job.id == job_id)
                session.execute(ended.values(state="failed", error={}, finished_at=utc_now()))
            proxy.become("open")

        thread = threading.Thread(target=outage)
        thread.start()
        asyncio.run(wait_for(JobWatch(through), job_id))
        thread.join()
        through.dispose()
    direct.dispose()


def test_who_is_let_go_does_not_wait_and_nobody_does_after(database):
    async def wait_and_release():
        watch = JobWatch(database)
        waiting = asyncio.create_task(watch.wait("job_of_nobody", 3600.0))
        await asyncio.sleep(0.05)
        watch.release()
        await waiting
        await watch.wait("job_of_nobody", 3600.0)
        await watch._task

    asyncio.run(wait_and_release())


def read_events(response):
    blocks = [
        dict(line.split(": ", 1) for line in block.splitlines()) for block in response.text.split("\n\n")
    ]
    return [(each["event"], each.get("id"), json.loads(each["data"])) for each in blocks if "event" in each]


def test_a_stream_tells_a_job_to_its_end_and_nobody_elses(house, stranger):
    job_id = house.upload(house.campaign(), house.frame_bytes(), role="dark")["job_id"]
    house.work()
    place = f"/v1/jobs/{job_id}/events"
    answer = house.http.get(place)
    assert answer.headers["Content-Type"].startswith("text/event-stream")
    ((name, mark, data),) = read_events(answer)
    assert (name, data) == ("job", {"id": job_id, "state": "succeeded", "progress": 1.0, "attempt": 1})
    # who has seen the end is told once more that it is one
    assert read_events(house.http.get(place, headers={"Last-Event-ID": mark})) == [(name, mark, data)]
    assert stranger.get(place).status_code == 404


def test_a_stream_ends_with_the_right_to_it(house):
    campaign = house.campaign()
    key = house.post("/v1/keys", {"name": "board", "scopes": ["read"]})

    async def follow():
        watch = JobWatch(house.database)
        who = Who(key["id"], None)
        stream = watch.follow("campaign", campaign["id"], who)
        first = await anext(stream)
        others = [watch.follow("campaign", campaign["id"], who) for _ in range(MOST_STREAMS - 1)]
        await asyncio.gather(*(anext(each) for each in others))
        with pytest.raises(Problem):
            watch.admit(who)
        house.http.patch(f"/v1/campaigns/{campaign['id']}", json={"place": "roof"}).raise_for_status()
        second = await anext(stream)
        house.http.delete(f"/v1/keys/{key['id']}").raise_for_status()
        rest = [event async for event in stream]
        for each in others:
            await each.aclose()
        # a look that is under way has a connection
        await watch._task
        return first, second, rest

    first, second, rest = asyncio.run(follow())
    assert (first.kind, first.data["id"]) == ("campaign", campaign["id"])
    assert second.data["revision"] > first.data["revision"]
    assert [event.data for event in rest] == [{"code": "unauthenticated"}]


def test_a_first_event_does_not_wait_for_the_next_look(house, monkeypatch):
    monkeypatch.setattr("service.jobs.watch._FOLLOWING_TICK_S", 60.0)
    campaign_id = house.campaign()["id"]
    who = Who(house.post("/v1/keys", {"name": "board", "scopes": ["read"]})["id"], None)

    async def follow():
        watch = JobWatch(house.database)
        streams = [watch.follow("campaign", campaign_id, who) for _ in range(2)]
        found = [await asyncio.wait_for(anext(each), 20) for each in streams]
        for each in streams:
            await each.aclose()
        watch._task.cancel()
        return found

    assert [event.data["id"] for event in asyncio.run(follow())] == [campaign_id] * 2
