"""Large campaigns: one frame is uploaded and read, the others are its rows once more under other names."""

import hashlib
from pathlib import Path
from typing import Any

from sqlalchemy import select, update

import stilb
from bench.bulk import write_rows
from bench.subject import CAMERA, Scale, draw_roi, make_mosaic, write_copies
from bench.upload import KEY, Service
from store.tables import Base, Blob, CampaignReview, ChannelRow, Extraction, FrameRow, Job
from store.tables.base import new_id, utc_now
from worker.context import Context
from worker.runner import run


def do_jobs(worker: Context) -> None:
    """Do every job that is due."""
    due = select(Job.id).where(Job.state == "queued", Job.due_at <= utc_now()).order_by(Job.due_at)
    with worker.database.reading() as session:
        job_ids = session.scalars(due).all()
    for job_id in job_ids:
        run(worker, job_id)
    if job_ids:
        do_jobs(worker)


def review_all(worker: Context) -> None:
    """Compute every review that is stale."""
    while (campaign_id := worker.reviews.claim_next()) is not None:
        worker.reviews.renew(campaign_id)


def read_frame(size: Scale, service: Service, worker: Context, folder: Path) -> stilb.Frame:
    """Send a frame of this size to a campaign of its own, and have it read."""
    (path,) = write_copies(folder, make_mosaic(size), "none", names=1)
    with stilb.Client(service.url, KEY) as client:
        camera = client.create_camera(CAMERA.body.make, CAMERA.body.model, CAMERA.body.serial)
        campaign = client.create_campaign(camera.id).id
        client.set_roi(campaign, polygon=draw_roi(size).points)
        frame = client.push(campaign, path, role="light", scene="level-1")
    do_jobs(worker)
    return frame


def copy_frame(worker: Context, frame_id: str, times: int) -> None:
    """Add the frame, its statistics and their channels again, each time as a file that nobody has."""
    with worker.database.writing("bench") as session:
        frame = session.get_one(FrameRow, frame_id)
        statement = select(Extraction).where(Extraction.frame_id == frame_id)
        extraction = session.scalars(statement).one()
        channels = session.scalars(select(ChannelRow).where(ChannelRow.extraction_id == extraction.id)).all()
        rows: dict[type[Base], list[dict[str, Any]]] = {
            Blob: [],
            FrameRow: [],
            Extraction: [],
            ChannelRow: [],
        }
        for number in range(1, times):
            sha256 = hashlib.sha256(f"{frame_id} {number}".encode()).hexdigest()
            one, two = new_id("frm"), new_id("ext")
            name = f"DJI_{number:05}.DNG"
            rows[Blob].append({"sha256": sha256, "size_bytes": 1})
            rows[FrameRow].append(_read(frame) | {"id": one, "sha256": sha256, "filename": name})
            rows[Extraction].append(_read(extraction) | {"id": two, "frame_id": one})
            rows[ChannelRow] += [_read(each) | {"extraction_id": two} for each in channels]
        write_rows(session, rows)
        mine = CampaignReview.campaign_id == frame.campaign_id
        session.execute(update(CampaignReview).where(mine).values(revision=CampaignReview.revision + 1))


def _read(row: Base) -> dict[str, Any]:
    return {column.key: getattr(row, column.key) for column in row.__mapper__.columns}
