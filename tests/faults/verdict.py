"""What is lost, doubled or wrong after a drill: asked over HTTP, and counted in the database."""

import hashlib
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import httpx
from sqlalchemy import func, select

import stilb
from store.audit_check import check_audit
from store.database import Database
from store.tables import AuditEntry, Extraction, FrameRow, Job, Measurement
from tests.faults.load import Load
from tests.support.fieldwork import Figures, Shot, Team, figures_of

# What differs between two runs of the same: names, times, addresses.
_NAMES_OF_ONE_RUN = ("_at", "url", "links", "href", "sha256")
_ID = re.compile(r"[a-z]+_[0-9a-f]{20,}")


@dataclass(frozen=True, kw_only=True)
class Truth:
    """What comes of the work where nothing disturbs."""

    pictures: Mapping[str, tuple[Any, str]]
    """By the file's name: statistics and the hash of the preview."""
    figures: Figures
    measured: Mapping[str, Any]


@dataclass(kw_only=True)
class Verdict:
    """Each entry names what was found."""

    lost: list[str] = field(default_factory=list)
    twice: list[str] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)


def essence(answer: Any) -> Any:
    """An answer without what differs from run to run."""
    if isinstance(answer, dict):
        return {
            name: essence(value) for name, value in answer.items() if not name.endswith(_NAMES_OF_ONE_RUN)
        }
    if isinstance(answer, str) and _ID.fullmatch(answer):
        return "an id"
    return [essence(value) for value in answer] if isinstance(answer, list) else answer


def take_truth(load: Load, sent: Sequence[Shot]) -> Truth:
    """What a run without a fault gives, to the last bit."""
    with load.team.http() as http:
        pictures = {name: _picture(http, frame.id, frame.raw) for name, frame in _listed(load, sent).items()}
    return Truth(
        pictures=pictures,
        figures=figures_of(load.team.client.calibrate(load.campaign.id)),
        measured={name: essence(found.raw) for name, found in load.measured.items()},
    )


def judge(load: Load, sent: Sequence[Shot], truth: Truth, *, database: Database, stranger: Team) -> Verdict:
    """Compare what is there with what was sent, and with the truth."""
    verdict = Verdict()
    verdict.lost += [f"{trouble.asked}: {trouble.code}" for trouble in load.refused]
    verdict.lost += [f"{name} got no answer" for name in sorted(load.unanswered())]
    listed = _listed(load, sent)
    _judge_frames(load, sent, truth, listed, verdict)
    if not verdict.lost:
        _judge_results(load, truth, verdict)
    _count(load, sent, database, verdict)
    _judge_privacy(load, stranger, verdict)
    return verdict


def _listed(load: Load, sent: Sequence[Shot]) -> dict[str, stilb.Frame]:
    named = {frame.sha256: frame for frame in load.team.client.frames(load.campaign.id)}
    by_name = {shot.path.name: named.get(_digest(shot.path.read_bytes())) for shot in sent}
    return {name: frame for name, frame in by_name.items() if frame is not None}


def _judge_frames(
    load: Load, sent: Sequence[Shot], truth: Truth, listed: Mapping[str, stilb.Frame], verdict: Verdict
) -> None:
    with load.team.http() as http:
        for shot in sent:
            name = shot.path.name
            frame = listed.get(name)
            if frame is None:
                verdict.lost.append(f"{name} is not listed")
                continue
            if frame.state != "extracted":
                verdict.lost.append(f"{name} is {frame.state} {frame.raw.get('refusal')}")
                continue
            content = http.get(f"/v1/frames/{frame.id}/content")
            if content.status_code != 200:
                verdict.lost.append(f"{name}: its content answers {content.status_code}")
            elif content.content != shot.path.read_bytes():
                verdict.wrong.append(f"{name}: its content differs from what was sent")
            if _picture(http, frame.id, frame.raw) != truth.pictures[name]:
                verdict.wrong.append(f"{name}: its statistics or its preview differ")


def _picture(http: httpx.Client, frame_id: str, raw: Mapping[str, Any]) -> tuple[Any, str]:
    preview = http.get(f"/v1/frames/{frame_id}/preview.png")
    return essence(raw["statistics"]), _digest(preview.content) if preview.is_success else preview.text


def _judge_results(load: Load, truth: Truth, verdict: Verdict) -> None:
    if figures_of(load.team.client.calibrate(load.campaign.id)) != truth.figures:
        verdict.wrong.append("the card's K differs")
    before = figures_of(load.base.version)
    for version in load.team.client.calibrations(load.base.campaign.id):
        if figures_of(load.team.client.calibration(version.id)) != before:
            verdict.wrong.append(f"K of version {version.version} differs")
    for name, found in load.measured.items():
        if essence(load.team.client.measurement(found.id).raw) != truth.measured[name]:
            verdict.wrong.append(f"{name}: its measurement differs")


def _count(load: Load, sent: Sequence[Shot], database: Database, verdict: Verdict) -> None:
    with database.reading() as session:
        frames = session.scalars(select(FrameRow).where(FrameRow.campaign_id == load.campaign.id)).all()
        ids = [frame.id for frame in frames]
        hashes = Counter(frame.sha256 for frame in frames)
        created = _counts(AuditEntry.subject_id, ids).where(AuditEntry.action == "frame.create")
        measured = [frame.id for frame in load.base.frames.values()]
        counted = {
            "extraction": _counts(Extraction.frame_id, ids),
            "job": _counts(Job.subject_id, ids),
            "entry of its creation": created,
            "measurement": _counts(Measurement.frame_id, measured),
        }
        found = {what: dict(session.execute(rows).all()) for what, rows in counted.items()}
    verdict.twice += [f"a frame {count} times" for count in hashes.values() if count > 1]
    for what, counts in found.items():
        verdict.twice += [f"{count} times an {what} of {of}" for of, count in counts.items() if count > 1]
    if set(found["entry of its creation"]) != set(ids):
        verdict.lost.append("the audit trail does not tell of every frame")
    if extra := len(frames) - len(sent):
        (verdict.twice if extra > 0 else verdict.lost).append(f"{extra:+d} frames")
    versions = [version.version for version in load.team.client.calibrations(load.base.campaign.id)]
    # One before the fault and one during it, however often that was asked for.
    if sorted(versions) != [1, 2]:
        (verdict.twice if len(versions) > 2 else verdict.lost).append(f"versions {versions}")
    _, broken = check_audit(database)
    if broken is not None:
        verdict.wrong.append(f"the audit trail breaks at {broken.seq}: {broken.what}")


def _counts(column: Any, ids: list[str]) -> Any:
    return select(column, func.count()).where(column.in_(ids)).group_by(column)


def _judge_privacy(load: Load, stranger: Team, verdict: Verdict) -> None:
    own = {frame.id for frame in load.team.client.frames(load.campaign.id)}
    with stranger.http() as http:
        for frame_id in sorted(own)[:3]:
            for path in ("", "/content", "/preview.png"):
                if http.get(f"/v1/frames/{frame_id}{path}").status_code != 404:
                    verdict.wrong.append(f"a stranger sees {frame_id}{path}")


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
