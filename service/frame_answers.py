"""Frames as the API answers them: with their statistics, and the verdict on each."""

from collections.abc import Mapping

from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.frame.verdicts import Verdict
from service.schemas.frames import FrameAnswer, StatisticsRow
from store.blobs import StoredBlob
from store.queries.frames import extractions_of, statistics_of
from store.queries.jobs import find_reading_jobs
from store.reviews import judge_alone
from store.tables import Blob, Campaign, FrameRow, Job


def answer_frames(
    session: Session, frames: list[FrameRow], verdicts: Mapping[str, Verdict]
) -> list[FrameAnswer]:
    """Return frames with their statistics, in four queries however many they are."""
    extractions = extractions_of(session, [frame.id for frame in frames])
    rows = statistics_of(session, [e.id for found in extractions.values() for e in found])
    stored = session.scalars(select(Blob).where(Blob.sha256.in_({frame.sha256 for frame in frames})))
    blobs = {blob.sha256: blob for blob in stored}
    jobs = find_reading_jobs(session, [frame.id for frame in frames])
    return [
        FrameAnswer.of(
            frame,
            blob=blobs[frame.sha256],
            statistics=[
                StatisticsRow.of(extraction, row)
                for extraction in extractions[frame.id]
                for row in rows[extraction.id]
            ],
            verdict=verdicts.get(frame.id),
            job_id=jobs.get(frame.id),
        )
        for frame in frames
    ]


def answer_write(
    session: Session,
    frame: FrameRow,
    campaign: Campaign,
    jobs: list[Job],
    *,
    stored: StoredBlob | None = None,
) -> FrameAnswer:
    """Return a frame that was just written, with the job that reads it."""
    # nobody else may write meanwhile: the frame is not compared with a whole campaign here
    verdict = judge_alone(session, frame, campaign) if jobs else None
    if stored is not None:
        # the frame is new: nothing else is known of it
        blob = Blob(sha256=stored.sha256, size_bytes=stored.size_bytes)
        answer = FrameAnswer.of(frame, blob=blob, statistics=[], verdict=verdict)
    else:
        answer = answer_frames(session, [frame], {frame.id: verdict} if verdict else {})[0]
    return answer.model_copy(update={"job_id": jobs[0].id}) if jobs else answer
