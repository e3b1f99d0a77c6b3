"""How the cost of looking at a campaign and adding to it grows; memory that certificates and plots take."""

import itertools
import os
import statistics
import threading
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import httpx
import numpy as np
from sqlalchemy import delete, event
from sqlalchemy.engine import Engine

import stilb
from bench.filling import copy_frame, do_jobs, review_all
from bench.memory import forget_peak, read_memory_mb
from bench.report import judge, say, show_times
from bench.subject import CAMERA, Scale, draw_roi, make_mosaic, write_copies
from bench.timing import Ratio, Seconds, compare, take_turns
from bench.upload import KEY, Service, open_http, renew
from radiometry.frame.exposure import Settings as Exposure
from simulation.dng import write_dng
from store.queries.evidence import gather
from store.tables import Campaign, Rendering
from worker.context import Context

_SMALL = Scale(rows=480, cols=640)
_SCENES = {"bright": (1600, 40.0), "middle": (800, 20.0), "dim": (400, 10.0)}


def run(scale: Scale, service: Service, worker: Context, folder: Path) -> list[bool]:
    """Compare a campaign of ``grown`` frames with one of a hundredth of that; make certificates and plots."""
    with stilb.Client(service.url, KEY) as client, open_http(service) as http:
        return [
            *_grow(scale, folder, client, http, worker),
            *_certify(scale, folder, service, client, http, worker),
        ]


def _grow(
    scale: Scale, folder: Path, client: stilb.Client, http: httpx.Client, worker: Context
) -> list[bool]:
    few, many = max(scale.grown // 100, 2), scale.grown
    say(f"\na campaign of {many:,} frames beside one of {few:,}")
    (path,) = write_copies(folder, make_mosaic(scale), "none", names=1)
    camera = client.create_camera(CAMERA.body.make, CAMERA.body.model, CAMERA.body.serial)
    fresh = itertools.count(1)
    frames: dict[int, stilb.Frame] = {}
    for count in (few, many):
        campaign = client.create_campaign(camera.id).id
        client.set_roi(campaign, polygon=draw_roi(scale).points)
        renew(path, next(fresh))
        frames[count] = client.push(campaign, path, role="light", scene="level-1")
        do_jobs(worker)
        copy_frame(worker, frames[count].id, count)
        review_all(worker)

    def get(template: str, count: int) -> Callable[[], object]:
        frame = frames[count]
        path = template.format(frame=frame.id, campaign=frame.raw["campaign_id"])
        return lambda: http.get(path).raise_for_status()

    def add(count: int) -> object:
        renew(path, next(fresh))
        frame = client.push(str(frames[count].raw["campaign_id"]), path, role="light", scene="level-1")
        do_jobs(worker)
        review_all(worker)
        return http.get(f"/v1/frames/{frame.id}").raise_for_status()

    verdicts = []
    for text, template in {
        "one frame": "/v1/frames/{frame}",
        "a page of 100 frames": "/v1/campaigns/{campaign}/frames?limit=100",
        "the campaign": "/v1/campaigns/{campaign}",
        "its checklist": "/v1/campaigns/{campaign}/checklist",
    }.items():
        ways = {f"{text}, of {count:,}": get(template, count) for count in (few, many)}
        verdicts.append(_compare(text, take_turns(ways, rounds=scale.rounds), at_most=1.5))
    ways = {f"adding a frame to {count:,}": (lambda count=count: add(count)) for count in (few, many)}
    seconds = take_turns(ways, rounds=scale.uploads, warm_up=1)
    return [
        *verdicts,
        _compare("adding a frame, with the verdicts on all", seconds, at_most=3.0),
        _count_statements(worker, [str(frame.raw["campaign_id"]) for frame in frames.values()]),
    ]


def _count_statements(worker: Context, campaigns: list[str]) -> bool:
    """Read what a fit reads; the smaller campaign first, so that the larger one adds to the memory."""
    counts = []
    for campaign_id in campaigns:
        executed: list[str] = []

        def note(*told: Any, executed: list[str] = executed) -> None:  # noqa: ANN401  SQLAlchemy's
            executed.append(told[2])

        before_mb = read_memory_mb(os.getpid(), "VmRSS")
        forget_peak(os.getpid())
        event.listen(Engine, "before_cursor_execute", note)
        with worker.database.reading() as session:
            read = len(gather(session, session.get_one(Campaign, campaign_id)).frames)
        event.remove(Engine, "before_cursor_execute", note)
        more_mb = read_memory_mb(os.getpid(), "VmHWM") - before_mb
        say(f"  a fit's input of {read:,} frames: {len(executed)} statements, at most {more_mb:.0f} MB more")
        counts.append(len(executed))
    small, large = counts
    grown = large / small
    return judge("statements of a fit's input: large to small", Ratio(grown, grown, grown), at_most=1.0)


def _compare(text: str, seconds: dict[str, Seconds], *, at_most: float) -> bool:
    show_times(seconds)
    small, large = seconds.values()
    return judge(f"{text}: large to small", compare(large, small), at_most=at_most)


def _certify(
    scale: Scale, folder: Path, service: Service, client: stilb.Client, http: httpx.Client, worker: Context
) -> list[bool]:
    say(f"\n{scale.certificates} certificates, each with other content, and as many plots")
    version = _calibrate(folder, client, worker)
    camera, campaign = version.camera_id, str(version.raw["campaign_id"])
    number = itertools.count()

    def certify() -> None:
        item = {"key": "equipment_lamp", "done": True, "note": f"note {next(number)}"}
        http.patch(f"/v1/campaigns/{campaign}/checklist", json={"items": [item]}).raise_for_status()
        http.get(f"/v1/calibrations/{version.id}/certificate.pdf").raise_for_status()

    def draw() -> None:
        with worker.database.writing("bench") as session:
            session.execute(delete(Rendering))
        http.get(f"/v1/calibrations/{version.id}/plot.svg").raise_for_status()

    def time_looks(make: Callable[[], None]) -> list[float]:
        threads = [threading.Thread(target=make) for _ in range(min(4, scale.certificates))]
        for thread in threads:
            thread.start()
        beside = [look()]
        while any(thread.is_alive() for thread in threads):
            beside.append(look())
        return beside

    def look() -> float:
        began = time.perf_counter()
        http.get(f"/v1/cameras/{camera}").raise_for_status()
        return time.perf_counter() - began

    makers = {"certificates": certify, "plots": draw}
    for make in makers.values():
        make()
    alone = [look() for _ in range(10 * scale.rounds)]
    verdicts = []
    for name, make in makers.items():
        before_mb = read_memory_mb(service.pid, "VmRSS")
        for _ in range(scale.certificates):
            make()
        after_mb = read_memory_mb(service.pid, "VmRSS")
        say(f"  {name}: the service's memory: {before_mb:.0f} MB before, {after_mb:.0f} MB after")
        beside = time_looks(make)
        show_times({"a look-up, alone": alone, f"a look-up during four {name}": beside})
        median = statistics.median(beside) / statistics.median(alone)
        grown = after_mb / before_mb
        verdicts += [
            judge(f"memory after {name}, to before", Ratio(grown, grown, grown), at_most=1.1),
            judge(f"a look-up during four {name}, to alone", Ratio(median, median, median), at_most=3.0),
        ]
    return verdicts


def _calibrate(folder: Path, client: stilb.Client, worker: Context) -> stilb.Calibration:
    """Fit three scenes of two frames each."""
    random = np.random.default_rng(2)
    camera = client.create_camera(CAMERA.body.make, CAMERA.body.model, CAMERA.body.serial)
    campaign = client.create_campaign(camera.id).id
    client.set_roi(campaign, polygon=draw_roi(_SMALL).points)
    taken_at = datetime(2026, 5, 1, 20, 0, tzinfo=UTC)
    for scene, (signal_dn, luminance) in _SCENES.items():
        for f_number in (4.0, 4.0 * 2**0.5):
            level = CAMERA.sensor.black_level_dn + signal_dn * 16 / f_number**2
            mosaic = random.normal(level, 8.0, (_SMALL.rows, _SMALL.cols)).astype(np.uint16)
            path = folder / f"{scene}-{f_number:.1f}.dng"
            exposure = Exposure(exposure_time_s=0.01, f_number=f_number, iso=3200)
            write_dng(path, mosaic, camera=CAMERA, settings=exposure, taken_at=taken_at)
            client.push(campaign, path, role="light", scene=scene)
        reading = {"scene": scene, "quantity": "luminance", "value": luminance, "unit": "cd/m2"}
        client.add_readings(campaign, [reading])
    do_jobs(worker)
    job = client.start_calibration(campaign)
    do_jobs(worker)
    return client.calibration(str(client.wait(job).result["calibration_id"]))
