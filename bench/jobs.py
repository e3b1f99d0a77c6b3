"""How the cost of what everybody does grows with the jobs and campaigns that are stored."""

import os
from collections.abc import Callable

from sqlalchemy import select, update

import stilb
from bench.bulk import write_rows
from bench.report import judge, say, show_times
from bench.subject import CAMERA, Scale
from bench.timing import Seconds, compare, take_turns
from bench.upload import KEY, Service, open_http
from store.jobs import begin, take_back
from store.jobs.queues import choose_messages, touch
from store.tables import Camera, Campaign, Job
from store.tables.base import new_id, utc_now
from worker.context import Context

_FEW = 100
_QUEUED_SHARE = 0.4
_JOBS_OF_A_CAMPAIGN = 100
_FRAME_BYTES = 20_000


def run(scale: Scale, service: Service, worker: Context) -> list[bool]:
    """Measure with a hundred jobs, then with a thousand times as many; four in ten wait for a worker."""
    say(f"\nwhat {scale.jobs:,} jobs and {scale.jobs // _JOBS_OF_A_CAMPAIGN:,} campaigns cost, beside {_FEW}")
    measured: list[dict[str, Seconds]] = []
    with stilb.Client(service.url, KEY) as client, open_http(service) as http:
        camera = client.create_camera(CAMERA.body.make, CAMERA.body.model, CAMERA.body.serial)
        campaign = client.create_campaign(camera.id).id

        def get(path: str) -> Callable[[], object]:
            return lambda: http.get(path).raise_for_status()

        full = round(_FEW * _QUEUED_SHARE)  # a page is full both times: half a page costs half as much
        ways: dict[str, Callable[[], object]] = {
            "a page of queued jobs": get(f"/v1/jobs?state=queued&limit={full}"),
            "a page of campaigns": get("/v1/campaigns?limit=10"),
            "a campaign": get(f"/v1/campaigns/{campaign}"),
            "the metrics": get("/metrics"),
            "an upload of 20 kB": lambda: http.post(
                f"/v1/campaigns/{campaign}/frames?role=field", content=os.urandom(_FRAME_BYTES)
            ).raise_for_status(),
            "choosing a job, and its begin": lambda: _begin_next(worker),
            "taking back lost jobs": lambda: _take_back(worker),
        }
        for count in (_FEW, scale.jobs - _FEW):
            _fill(worker, camera.id, count)
            measured.append(take_turns(ways, rounds=scale.rounds, warm_up=1))
    few, many = measured
    show_times({f"{name}, of {scale.jobs:,}": each for name, each in many.items()})
    return [judge(f"{name}: many to few", compare(many[name], few[name]), at_most=1.5) for name in ways]


def _begin_next(worker: Context) -> None:
    with worker.database.writing("bench") as session:
        touch(session, "fits")
        message, *others = choose_messages(session)
        session.execute(update(Job).where(Job.id.in_([each.task_id for each in others])).values(sent_at=None))
        begin(session, str(message.task_id), lease_s=30.0)


def _take_back(worker: Context) -> None:
    with worker.database.writing("bench") as session:
        take_back(session, Job.lease_until < utc_now())


def _fill(worker: Context, camera_id: str, count: int) -> None:
    with worker.database.writing("bench") as session:
        organisation = session.scalars(select(Camera.organisation_id).where(Camera.id == camera_id)).one()
        every = {"organisation_id": organisation, "camera_id": camera_id, "method": "luminance"}
        campaigns = [{"id": new_id("cmp"), **every} for _ in range(max(1, count // _JOBS_OF_A_CAMPAIGN))]
        queued = round(count * _QUEUED_SHARE)
        of_jobs = [
            {
                "organisation_id": organisation,
                "kind": "fit",
                "lane": "fit",
                "subject_id": campaigns[number % len(campaigns)]["id"],
                "created_by": "bench",
                "state": "queued" if number < queued else "succeeded",
            }
            for number in range(count)
        ]
        write_rows(session, {Campaign: campaigns, Job: of_jobs})
