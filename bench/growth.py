"""How the cost of a campaign grows with its frames, and of the service with its jobs and campaigns."""

import os
import tempfile
from collections.abc import Callable
from itertools import count
from pathlib import Path

import httpx
from sqlalchemy import select, update

import stilb
from bench import harness
from bench.frames import CAMERA, copy_frame, review_all, send_frame, write_rows
from bench.harness import Scale, Seconds, Service, judge, say
from store.jobs import begin, queues, take_back
from store.settings import Settings
from store.tables import Camera, Campaign, Job, new_id, utc_now
from worker.context import Context, build_context
from worker.decode.pool import DecoderPool

_FEW_JOBS = 100
_QUEUED_SHARE = 0.4
_JOBS_OF_A_CAMPAIGN = 100


def run(scale: Scale) -> list[bool]:
    """Measure one service, with a worker that is called where it is needed."""
    with (
        tempfile.TemporaryDirectory(prefix="stilb-bench-") as name,
        harness.serving(Path(name) / "data") as service,
    ):
        settings = Settings(data=Path(name) / "data")
        worker = build_context(settings, DecoderPool())
        worker.database.post = None
        try:
            with service.open_http() as http:
                verdicts = _grow(scale, service, worker, http, Path(name))
                return verdicts + _add_jobs(scale, service, worker, http)
        finally:
            worker.decoders.close()
            worker.database.dispose()


def _grow(scale: Scale, service: Service, worker: Context, http: httpx.Client, folder: Path) -> list[bool]:
    few, many = max(scale.grown // 100, 2), scale.grown
    say(f"\na campaign of {many:,} frames beside one of {few:,}")
    size, number = Scale(rows=480, cols=640), count(1)
    frames: dict[str, str] = {}
    for times in (few, many):
        frame = send_frame(size, service, worker, folder, number=next(number))
        copy_frame(worker, frame.id, times)
        review_all(worker)
        frames[str(frame.raw["campaign_id"])] = frame.id

    def get(template: str, campaign: str) -> Callable[[], object]:
        path = template.format(frame=frames[campaign], campaign=campaign)
        return lambda: http.get(path).raise_for_status()

    def add(campaign: str) -> object:
        frame = send_frame(size, service, worker, folder, number=next(number), campaign=campaign)
        return http.get(f"/v1/frames/{frame.id}").raise_for_status()

    verdicts = []
    for text, template in {
        "one frame": "/v1/frames/{frame}",
        "a page of 100 frames": "/v1/campaigns/{campaign}/frames?limit=100",
        "the campaign": "/v1/campaigns/{campaign}",
        "its checklist": "/v1/campaigns/{campaign}/checklist",
    }.items():
        ways = {each: get(template, each) for each in frames}
        verdicts.append(_judge(text, ways, rounds=scale.rounds, at_most=1.5))
    adding = {each: (lambda each=each: add(each)) for each in frames}
    said = "adding a frame, with the verdicts on all"
    return [*verdicts, _judge(said, adding, rounds=scale.uploads, at_most=3.0)]


def _judge(text: str, ways: harness.Ways, *, rounds: int, at_most: float) -> bool:
    few, many = harness.take_turns(ways, rounds=rounds, warm_up=1).values()
    harness.show_times({f"{text}: few": few, f"{text}: many": many})
    return judge(f"{text}: many to few", harness.compare(many, few), at_most=at_most)


def _add_jobs(scale: Scale, service: Service, worker: Context, http: httpx.Client) -> list[bool]:
    """Measure with a hundred jobs, then with a thousand times as many; four in ten wait for a worker."""
    say(f"\n{scale.jobs:,} jobs and {scale.jobs // _JOBS_OF_A_CAMPAIGN:,} campaigns beside {_FEW_JOBS}")
    with stilb.Client(service.url, harness.KEY) as client:
        camera = client.create_camera(CAMERA.body.make, CAMERA.body.model, CAMERA.body.serial).id
        campaign = client.create_campaign(camera).id

    def get(path: str) -> Callable[[], object]:
        return lambda: http.get(path).raise_for_status()

    def upload() -> None:
        address = f"/v1/campaigns/{campaign}/frames?role=field"
        http.post(address, content=os.urandom(20_000)).raise_for_status()

    full = round(_FEW_JOBS * _QUEUED_SHARE)  # a page is full both times: half a page costs half as much
    ways: dict[str, Callable[[], object]] = {
        "a page of queued jobs": get(f"/v1/jobs?state=queued&limit={full}"),
        "a page of campaigns": get("/v1/campaigns?limit=10"),
        "a campaign": get(f"/v1/campaigns/{campaign}"),
        "the metrics": get("/metrics"),
        "an upload of 20 kB": upload,
        "choosing a job, and its begin": lambda: _begin_next(worker),
        "taking back lost jobs": lambda: _take_back(worker),
    }
    measured: list[dict[str, Seconds]] = []
    for number in (_FEW_JOBS, scale.jobs - _FEW_JOBS):
        _fill(worker, camera, number)
        measured.append(harness.take_turns(ways, rounds=scale.rounds, warm_up=1))
    few, many = measured
    harness.show_times(many)
    ratios = {name: harness.compare(many[name], few[name]) for name in ways}
    return [judge(f"{name}: many to few", ratio, at_most=1.5) for name, ratio in ratios.items()]


def _begin_next(worker: Context) -> None:
    with worker.database.writing("bench") as session:
        queues.touch(session, "fits")
        message, *others = queues.choose_messages(session)
        session.execute(update(Job).where(Job.id.in_([each.task_id for each in others])).values(sent_at=None))
        begin(session, str(message.task_id), lease_s=30.0)


def _take_back(worker: Context) -> None:
    with worker.database.writing("bench") as session:
        take_back(session, Job.lease_until < utc_now())


def _fill(worker: Context, camera_id: str, number: int) -> None:
    with worker.database.writing("bench") as session:
        of = {"organisation_id": session.scalars(select(Camera.organisation_id)).first()}
        campaigns = [new_id("cmp") for _ in range(max(1, number // _JOBS_OF_A_CAMPAIGN))]
        about = of | {"camera_id": camera_id, "method": "luminance"}
        job = of | {"kind": "fit", "lane": "fit", "created_by": "bench"}
        states = ["queued" if each < number * _QUEUED_SHARE else "succeeded" for each in range(number)]
        jobs = (
            job | {"state": state, "subject_id": campaigns[each % len(campaigns)]}
            for each, state in enumerate(states)
        )
        write_rows(session, {Campaign: (about | {"id": each} for each in campaigns), Job: jobs})
