"""The frame that is measured on, its region, and campaigns of many frames."""

import hashlib
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import insert, select, update
from sqlalchemy.orm import Session

import stilb
from bench.harness import KEY, Scale, Service
from radiometry.frame import exposure, roi
from simulation.camera import Camera
from simulation.dng import Compression, write_dng
from store.tables import Base, Blob, CampaignReview, ChannelRow, Extraction, FrameRow, Job, new_id, utc_now
from worker import context, runner

CAMERA = Camera()
ROI_SHARE = 0.05
NAMES = 6  # more than the decoding process keeps open


def make_mosaic(scale: Scale) -> NDArray[np.uint16]:
    """A surface lit from one side with the noise of photons: it compresses as a real frame does [DN]."""
    random = np.random.default_rng(1)
    light = np.linspace(600.0, 2400.0, scale.cols, dtype=np.float32)
    mosaic = np.empty((scale.rows, scale.cols), np.uint16)
    for row in mosaic:
        noise = np.sqrt(light * 0.5 + 16.0) * random.standard_normal(scale.cols, np.float32)
        row[:] = np.rint(CAMERA.sensor.black_level_dn + light + noise)
    return mosaic


def draw_roi(scale: Scale) -> roi.Polygon:
    """A taped rectangle as a hand draws it, 5 % of the frame, off every border of a tile."""
    height, width = scale.rows * ROI_SHARE**0.5, scale.cols * ROI_SHARE**0.5
    across, down = np.array([width, 0.02 * width]), np.array([-0.02 * height, height])
    corner = np.array([scale.cols * 0.41, scale.rows * 0.37])
    corners = (corner, corner + across, corner + across + down, corner + down)
    return roi.Polygon.from_points([(float(x), float(y)) for x, y in corners])


def write_copies(
    folder: Path, mosaic: NDArray[np.uint16], compression: Compression = "none", *, names: int = 1
) -> list[Path]:
    """One file under several names: a reader that keeps files open meets a new one each time."""
    first, *others = (folder / f"{compression}-{number}.dng" for number in range(names))
    settings = exposure.Settings(exposure_time_s=0.01, f_number=4.0, iso=3200)
    taken_at = datetime(2026, 5, 1, 20, 0, tzinfo=UTC)
    write_dng(first, mosaic, camera=CAMERA, settings=settings, taken_at=taken_at, compression=compression)
    for other in others:
        other.hardlink_to(first)
    return [first, *others]


def renew(path: Path, number: int) -> None:
    """Change eight bytes: the service keeps equal bytes once, and would have less to do."""
    with path.open("r+b") as file:
        file.seek(-4096, 2)
        file.write(number.to_bytes(8, "little"))


def create_campaign(client: stilb.Client) -> str:
    camera = client.create_camera(CAMERA.body.make, CAMERA.body.model, CAMERA.body.serial)
    return client.create_campaign(camera.id).id


def send_frame(
    scale: Scale, service: Service, worker: context.Context, folder: Path, *, number: int, campaign: str = ""
) -> stilb.Frame:
    """Send a frame with bytes of its own to a campaign, new unless one is named; have it read and judged."""
    path = folder / f"{scale.rows}.dng"
    if not path.exists():
        write_copies(folder, make_mosaic(scale))[0].rename(path)
    renew(path, number)
    with stilb.Client(service.url, KEY) as client:
        if not campaign:
            campaign = create_campaign(client)
            client.set_roi(campaign, polygon=draw_roi(scale).points)
        frame = client.push(campaign, path, role="light", scene="level-1")
    do_jobs(worker)
    review_all(worker)
    return frame


def do_jobs(worker: context.Context) -> None:
    due = select(Job.id).where(Job.state == "queued", Job.due_at <= utc_now()).order_by(Job.due_at)
    with worker.database.reading() as session:
        job_ids = session.scalars(due).all()
    for job_id in job_ids:
        runner.run(worker, job_id)
    if job_ids:
        do_jobs(worker)


def review_all(worker: context.Context) -> None:
    while (campaign_id := worker.reviews.claim_next()) is not None:
        worker.reviews.renew(campaign_id)


def copy_frame(worker: context.Context, frame_id: str, times: int) -> None:
    """Add the frame, its statistics and their channels again, each time as a file that nobody has."""
    with worker.database.writing("bench") as session:
        frame = session.get_one(FrameRow, frame_id)
        extraction = session.scalars(select(Extraction).where(Extraction.frame_id == frame_id)).one()
        channels = session.scalars(select(ChannelRow).where(ChannelRow.extraction_id == extraction.id)).all()
        rows: dict[type[Base], list[dict[str, Any]]] = {}
        for number in range(1, times):
            sha256 = hashlib.sha256(f"{frame_id} {number}".encode()).hexdigest()
            one, two = new_id("frm"), new_id("ext")
            name = f"DJI_{number:05}.DNG"
            rows.setdefault(Blob, []).append({"sha256": sha256, "size_bytes": 1})
            rows.setdefault(FrameRow, []).append(
                _read(frame) | {"id": one, "sha256": sha256, "filename": name}
            )
            rows.setdefault(Extraction, []).append(_read(extraction) | {"id": two, "frame_id": one})
            rows.setdefault(ChannelRow, []).extend(_read(each) | {"extraction_id": two} for each in channels)
        write_rows(session, rows)
        mine = CampaignReview.campaign_id == frame.campaign_id
        session.execute(update(CampaignReview).where(mine).values(revision=CampaignReview.revision + 1))


def _read(row: Base) -> dict[str, Any]:
    return {column.key: getattr(row, column.key) for column in row.__mapper__.columns}


def write_rows(session: Session, rows: Mapping[type[Base], Iterable[Mapping[str, Any]]]) -> None:
    """Add rows by table, those that others refer to first."""
    places = Base.metadata.sorted_tables
    for table in sorted(rows, key=lambda each: places.index(each.__mapper__.local_table)):
        if listed := list(rows[table]):
            session.execute(insert(table), listed)
