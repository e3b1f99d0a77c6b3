"""The stretches of the way that every method goes: campaign, frames, fit, publication, what is in force.

Going them again, with the same files, changes nothing and ends the same.
"""

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from datetime import datetime
from pathlib import Path
from typing import Unpack

import stilb
from demo.display import Display
from demo.findings import Finding, as_table
from demo.stage import Stage
from stilb.records import CampaignDetails

# numpy's generators give up the interpreter's lock while they draw, which is most of the work.
_THREADS = 2


def write_files(stage: Stage, writers: Sequence[Callable[[], Path]]) -> list[Path]:
    """Simulate and write every file, in order."""
    stage.folder.mkdir(parents=True, exist_ok=True)
    paths: list[Path] = []
    with (
        stage.display.stage(f"simulating {len(writers)} frames") as advance,
        ThreadPoolExecutor(max_workers=_THREADS) as pool,
    ):
        for path in pool.map(lambda write: write(), writers):
            paths.append(path)
            advance(len(paths) / len(writers))
    return paths


def ensure_campaign(
    client: stilb.Client, camera_id: str, method: str, **details: Unpack[CampaignDetails]
) -> str:
    """Give a campaign's id; without a natural key, the project's number tells an earlier run's."""
    wanted = (camera_id, method, details["project_number"])
    for known in client.campaigns():
        if (known.camera_id, known.method, known.project_number) == wanted:
            return known.id
    details["recorder"] = "the demo"
    return client.create_campaign(camera_id, method=method, **details).id


def send(stage: Stage, uploads: Iterable[stilb.Upload]) -> list[stilb.Frame]:
    """Send files and wait until they are read."""
    wanted = list(uploads)
    size_mb = sum(Path(upload.path).stat().st_size for upload in wanted) / 1e6
    with stage.display.stage(f"sending {len(wanted)} frames, {size_mb:.0f} MB") as advance:
        frames = stage.client.push_all(
            wanted, on_progress=lambda progress: advance(progress.bytes_sent / progress.bytes_total)
        )
    _wait_for_statistics(stage.client, frames, stage.display)
    return frames


def calibrate(
    stage: Stage,
    campaign_id: str,
    *,
    valid_from: datetime,
    valid_to: datetime | None = None,
    **params: object,
) -> stilb.Calibration:
    """Fit and put in force; an earlier run's version is in force already."""
    with stage.display.stage("fitting"):
        found = stage.client.calibrate(campaign_id, **params)
        if found.state == "draft":
            reason = "simulated campaign, checked by the demo"
            stage.client.publish(found.id, valid_from=valid_from, valid_to=valid_to, reason=reason)
    return stage.client.calibration(found.id)


def conclude(stage: Stage, calibration: stilb.Calibration, findings: Sequence[Finding]) -> bool:
    """Show the findings; whether all of them agree with the truth."""
    stage.display.show(as_table(calibration.method, findings))
    stage.display.say(f"version {calibration.version} is {calibration.state}")
    return bool(findings) and all(finding.agrees for finding in findings)


def _wait_for_statistics(client: stilb.Client, frames: list[stilb.Frame], display: Display) -> None:
    """A frame of an earlier run has its statistics, and no job to wait for."""
    with display.stage("reading the frames") as advance:
        for done, frame in enumerate(frames, start=1):
            if frame.job_id is not None:
                client.wait(frame.job_id)
            advance(done / len(frames))
