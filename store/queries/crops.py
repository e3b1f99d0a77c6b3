"""Crops of frames that are kept: found again, and as many as an organisation may have."""

from collections.abc import Sequence
from typing import Final

from sqlalchemy import delete, select
from sqlalchemy.orm import Session

from store.tables import Blob, Crop, FrameRow, Job

MOST_KEPT: Final = 32
"""Of an organisation: with the largest crop there is they take 32 MiB of the database."""


def say_asked(window: Sequence[int], low_dn: float | None, high_dn: float | None) -> str:
    """Return the text under which a crop is found again."""
    return " ".join(map(str, (*window, low_dn, high_dn)))


def find_crop_job(session: Session, frame: FrameRow, asked: str) -> Job | None:
    """Return the job that drew what is asked for, while its picture is kept and its file is whole."""
    kept = (
        select(Job)
        .join(Crop, Crop.job_id == Job.id)
        .join(Blob, Blob.sha256 == frame.sha256)
        .where(Crop.frame_id == frame.id, Crop.asked == asked, Blob.damage.is_(None))
    )
    return session.scalar(kept.order_by(Crop.id.desc()).limit(1))


def keep_crop(session: Session, crop: Crop) -> None:
    """Add a crop, and delete the oldest of its organisation beyond the most that are kept."""
    session.add(crop)
    session.flush()
    owns = Crop.organisation_id == crop.organisation_id
    last = session.scalar(select(Crop.id).where(owns).order_by(Crop.id.desc()).offset(MOST_KEPT).limit(1))
    if last is not None:
        session.execute(delete(Crop).where(owns, Crop.id <= last))
