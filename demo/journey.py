"""Steps that every method's demo takes: campaign, frames, fit, publication, comparison with the truth.

Taking them again, with the same files, changes nothing and ends the same.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Any, Self, Unpack

import numpy as np
from rich import box
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

import stilb
from radiometry.frame.roi import Polygon, Window
from radiometry.records import Record
from simulation.camera import Camera, Shot
from simulation.camera import take as expose
from simulation.dng import write_dng
from stilb.records import CampaignDetails

Advance = Callable[[float], None]  # takes the share that is done, 0..1


class Display:
    """One stage after another, each with its share done: a bar, or outside a terminal a line at its end."""

    def __init__(self, console: Console) -> None:
        self._console = console

    def say(self, text: str) -> None:
        """Print one line as it is."""
        self._console.print(text, highlight=False, soft_wrap=True)

    def show(self, table: Table) -> None:
        """Print a table."""
        self._console.print(table)

    @contextmanager
    def stage(self, name: str) -> Iterator[Advance]:
        """Show one stage from its begin to its end; the body reports how far it is."""
        columns = (BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
        with Progress(TextColumn("{task.description:<34}"), *columns, console=self._console) as progress:
            task = progress.add_task(name, total=1.0)
            yield lambda share: progress.update(task, completed=share)
            progress.update(task, completed=1.0)


AGREES_WITHIN = 3.0  # standard uncertainties


class Finding(Record):
    """One figure."""

    what: str
    value: float
    standard_uncertainty: float
    truth: float
    unit: str

    @classmethod
    def of(cls, what: str, found: stilb.Coefficient | stilb.Quantity, *, truth: float) -> Self:
        """Take a figure as the service reports it."""
        return cls(
            what=what,
            value=found.value,
            standard_uncertainty=found.standard_uncertainty,
            truth=truth,
            unit=found.unit,
        )

    @property
    def difference(self) -> float:
        """How far the figure lies from the truth, in its own standard uncertainties."""
        return (self.value - self.truth) / self.standard_uncertainty

    @property
    def agrees(self) -> bool:
        """Return True if the figure agrees with the truth."""
        return abs(self.difference) <= AGREES_WITHIN


def as_table(title: str, findings: Sequence[Finding]) -> Table:
    """Lay the findings out for a person."""
    table = Table(title=f"{title} beside the simulated truth", box=box.SIMPLE_HEAD)
    table.add_column("", no_wrap=True)
    for heading in ("found", "u", "truth", "off / u"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("unit")
    for one in findings:
        table.add_row(
            one.what,
            f"{one.value:.5g}",
            f"{one.standard_uncertainty:.2g}",
            f"{one.truth:.5g}",
            f"{one.difference:+.2f}" + ("" if one.agrees else " FAR"),
            "" if one.unit == "1" else one.unit,
        )
    return table


STARTED_AT = datetime(2026, 5, 1, 12, 0, tzinfo=UTC)

_BETWEEN_SHOTS = timedelta(seconds=20)
# numpy's generators release the interpreter's lock while they draw, which is most of the work.
_THREADS = 2


class Stage(Record):
    """Service, folder and display of one demo; ``quick`` asks for small frames and few, for a test.

    ``camera`` : one of the demo's ``CAMERAS``, "" for its first.
    """

    client: stilb.Client
    folder: Path
    display: Display
    quick: bool = False
    camera: str = ""


def register(stage: Stage, camera: Camera, **details: Any) -> str:  # noqa: ANN401  the client's own
    """Return the camera's id."""
    body = camera.body
    lens = {"make": body.lens_make, "model": body.lens_model, "serial": body.lens_serial}
    return stage.client.create_camera(
        body.make, body.model, body.serial, lens=lens, pixel_pitch_um=body.pixel_pitch_um, **details
    ).id


def begin(stage: Stage, camera_id: str, method: str, **details: Unpack[CampaignDetails]) -> str:
    """Return a campaign's id; without a natural key, the project number identifies that of an earlier run."""
    details = {"project_number": f"DEMO-{method}", "started_at": STARTED_AT, "recorder": "the demo"} | details
    number = details["project_number"]
    for known in stage.client.campaigns(camera_id=camera_id, method=method, project_number=number):
        return known.id
    return stage.client.create_campaign(camera_id, method=method, **details).id


def take(
    stage: Stage,
    campaign_id: str,
    shots: Sequence[Shot],
    *,
    camera: Camera,
    seed: int,
    started_at: datetime = STARTED_AT,
    roi: Polygon | None = None,
) -> list[stilb.Frame]:
    """Expose, write and send every shot; a part of a frame is sent with the region in its own pixels."""

    def write(number: int, shot: Shot) -> Path:
        path = stage.folder / f"{shot.frame}.DNG"
        samples = expose(camera, shot, np.random.default_rng([seed, number])).frame.samples_dn
        taken_at = started_at + number * _BETWEEN_SHOTS
        write_dng(path, samples, camera=camera, settings=shot.settings, taken_at=taken_at)
        return path

    paths = write_files(stage, [partial(write, number, shot) for number, shot in enumerate(shots)])
    return send(
        stage,
        [
            stilb.Upload(
                campaign_id=campaign_id,
                path=path,
                role=shot.role,
                scene=shot.scene,
                roi=see_from(shot.window, roi) if roi and shot.window else None,
            )
            for shot, path in zip(shots, paths, strict=True)
        ],
    )


def see_from(window: Window, roi: Polygon) -> tuple[tuple[float, float], ...]:
    """Return the corners (x, y) of a region of the whole sensor in the window's own pixels."""
    return tuple((x - window.col0, y - window.row0) for x, y in roi.points)


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


def send(stage: Stage, uploads: Iterable[stilb.Upload]) -> list[stilb.Frame]:
    """Send files and wait until they are read."""
    wanted = list(uploads)
    size_mb = sum(Path(upload.path).stat().st_size for upload in wanted) / 1e6
    with stage.display.stage(f"sending {len(wanted)} frames, {size_mb:.0f} MB") as advance:
        frames = stage.client.push_all(
            wanted, on_progress=lambda progress: advance(progress.bytes_sent / progress.bytes_total)
        )
    with stage.display.stage("reading the frames") as advance:
        for done, frame in enumerate(frames, start=1):
            stage.client.wait(frame.job_id)
            advance(done / len(frames))
    return frames


def calibrate(
    stage: Stage,
    campaign_id: str,
    *,
    valid_from: datetime = STARTED_AT,
    valid_to: datetime | None = None,
    **params: Any,  # noqa: ANN401  the method's own
) -> stilb.Calibration:
    """Fit and publish; the version of an earlier run is published already."""
    with stage.display.stage("fitting"):
        found = stage.client.calibrate(campaign_id, **params)
        if found.state == "draft":
            reason = "simulated campaign, checked by the demo"
            stage.client.publish(found.id, valid_from=valid_from, valid_to=valid_to, reason=reason)
    return stage.client.calibration(found.id)


def conclude(stage: Stage, calibration: stilb.Calibration, findings: Sequence[Finding]) -> bool:
    """Show the findings; return True if all of them agree with the truth."""
    stage.display.show(as_table(calibration.method, findings))
    stage.display.say(f"version {calibration.version} is {calibration.state}")
    return bool(findings) and all(finding.agrees for finding in findings)
