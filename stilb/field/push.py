"""Push of a folder to a campaign: hash, ask what is there, send the rest, wait until it is read, report."""

import hashlib
import json
import os
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Self

from stilb import problem, records, transport, upload
from stilb.client import Client
from stilb.field.files import FieldFile

Stamp = tuple[int, int]


def _stamp(path: Path) -> Stamp:
    found = path.stat()
    return found.st_size, found.st_mtime_ns


class Journal:
    """The hashes of a folder's files, each as long as size and time of the file stay."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._known: dict[str, tuple[int, int, str]] = {}
        if path.exists():
            for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
                self._take(line)

    @classmethod
    def of(cls, folder: Path, journals: Path) -> "Journal":
        """The journal of a folder, kept among this user's own: a card may be write-protected."""
        name = hashlib.sha256(os.fsencode(folder.resolve())).hexdigest()[:16]
        return cls(journals / f"{name}.jsonl")

    def hash_of(self, path: Path) -> str:
        """The file's SHA-256. ``OSError`` where it cannot be read, or changes while it is."""
        before = _stamp(path)
        if (known := self._known.get(str(path))) is not None and known[:2] == before:
            return known[2]
        sha256 = transport.hash_file(path)
        if _stamp(path) != before:
            raise OSError(f"{path} is still being written: push again when it is complete")
        self._append(path, (*before, sha256))
        return sha256

    def _append(self, path: Path, entry: tuple[int, int, str]) -> None:
        self._known[str(path)] = entry
        self._path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        with self._path.open("a", encoding="utf-8") as file:
            # The line break goes first: a line that a crash cut off then spoils no other.
            file.write("\n" + json.dumps([os.fsencode(path).hex(), *entry]))

    def _take(self, line: str) -> None:
        try:
            path, size, modified, sha256 = json.loads(line)
            self._known[str(Path(os.fsdecode(bytes.fromhex(path))))] = (int(size), int(modified), str(sha256))
        except (ValueError, TypeError):
            return


class Watch:
    """Files of a folder, each once two scans in a row have found it with the same size and time."""

    def __init__(self, list_files: Callable[[], list[FieldFile]]) -> None:
        self._list_files = list_files
        self._seen: dict[Path, Stamp] = {}
        self._given: dict[Path, Stamp] = {}

    def look(self) -> list[FieldFile]:
        """The files that have settled since; a file that changes later is given again."""
        files, now = self._list_files(), dict[Path, Stamp]()
        for file in files:
            with suppress(OSError):  # the card has just been pulled out
                now[file.path] = _stamp(file.path)
        settled = [
            file
            for file in files
            if (stamp := now.get(file.path)) is not None
            and self._seen.get(file.path) == stamp != self._given.get(file.path)
        ]
        self._seen = now
        self._given |= {file.path: now[file.path] for file in settled}
        return settled

    def take_back(self, files: list[FieldFile]) -> None:
        """Return these files to the queue, because they could not be sent."""
        for file in files:
            self._given.pop(file.path, None)


_UNREAD = frozenset({"not_read", "not_extracted"})
_ORDER = ("pass", "warn", "fail", "pending")
_POLL_S = 1.0
_PATIENCE_S = 60.0  # without any frame being read in that time


@dataclass(frozen=True, kw_only=True)
class Listener:
    """Receiver of progress; ``on_count``: of what is done, how many, of how many."""

    on_count: Callable[[str, int, int], None] = lambda *_: None
    on_progress: upload.OnProgress | None = None


@dataclass(frozen=True, kw_only=True)
class Told:
    """Outcome of one file. ``frame_id`` is empty where it did not arrive; the reasons then say why."""

    name: str
    sha256: str
    frame_id: str
    outcome: str
    reasons: tuple[str, ...] = ()
    codes: tuple[str, ...] = ()

    @classmethod
    def unsent(cls, name: str, reason: str, sha256: str = "") -> Self:
        return cls(name=name, sha256=sha256, frame_id="", outcome="not received", reasons=(reason,))


@dataclass(frozen=True, kw_only=True)
class Report:
    """Outcome of all files; ``sent`` counts those that went over the network this time."""

    campaign_id: str
    files: tuple[Told, ...]
    sent: int
    left_out: tuple[str, ...] = ()
    receipt: str | None = None  # where it was written

    @property
    def received(self) -> int:
        return sum(bool(file.frame_id) for file in self.files)

    @property
    def outcomes(self) -> dict[str, int]:
        """How many of those that arrived pass, warn, fail, or wait to be read."""
        counts = Counter(file.outcome for file in self.files if file.frame_id)
        return {outcome: counts[outcome] for outcome in _ORDER if counts[outcome]}

    @property
    def is_well(self) -> bool:
        return self.received == len(self.files) and "fail" not in self.outcomes

    def sentence(self) -> str:
        counts = [f"{count} {outcome}" for outcome, count in self.outcomes.items()]
        return ", ".join([f"{self.received} of {len(self.files)} received", *counts])


@dataclass(kw_only=True)
class _Push:
    """One push on its way: each step knows what those before it have found."""

    client: Client
    campaign_id: str
    files: Sequence[FieldFile]
    listener: Listener
    hashes: dict[str, str] = field(default_factory=dict)  # by name
    frames: dict[str, str] = field(default_factory=dict)  # ids, by hash
    errors: dict[str, str] = field(default_factory=dict)  # by name
    notes: dict[str, str] = field(default_factory=dict)  # by name
    jobs: list[str] = field(default_factory=list)


def push_files(
    client: Client,
    campaign_id: str,
    files: Sequence[FieldFile],
    journal: Journal,
    *,
    listener: Listener | None = None,
    wait: bool = True,
) -> Report:
    """Bring files to a campaign. Called again after whatever ended it, it goes on where it was."""
    push = _Push(client=client, campaign_id=campaign_id, files=files, listener=listener or Listener())
    _hash(push, journal)
    sent = _send(push, _choose(push))
    told = _wait_until_read(push) if wait else {}
    return Report(campaign_id=campaign_id, files=tuple(_tell(push, file, told) for file in files), sent=sent)


def _hash(push: _Push, journal: Journal) -> None:
    for number, file in enumerate(push.files, start=1):
        try:
            push.hashes[file.name] = journal.hash_of(file.path)
        except OSError as error:
            push.errors[file.name] = str(error)
        push.listener.on_count("hashed", number, len(push.files))


def _choose(push: _Push) -> list[FieldFile]:
    """The files that the service has not, each content once."""
    known = push.client.known_frames(push.campaign_id, push.hashes.values())
    there = {frame.sha256: frame for frame in known}
    push.frames |= {sha256: frame.frame_id for sha256, frame in there.items()}
    chosen: dict[str, FieldFile] = {}
    for file in push.files:
        sha256 = push.hashes.get(file.name)
        if sha256 in there:
            _compare(push, file, there[sha256])
        elif sha256 is not None:
            chosen.setdefault(sha256, file)
    return list(chosen.values())


def _compare(push: _Push, file: FieldFile, known: records.KnownFrame) -> None:
    if (known.role, known.scene) != (file.role, file.scene):
        push.notes[file.name] = (
            f"exists already as {_words(known.role, known.scene)} ({known.filename}), here it is "
            f"{_words(file.role, file.scene)}: it is not changed; correct the frame if needed"
        )


def _send(push: _Push, files: list[FieldFile]) -> int:
    uploads = []
    for file in files:
        said: dict[str, Any] = {"path": file.path, "role": file.role, "scene": file.scene, **file.details}
        uploads.append(upload.Upload(campaign_id=push.campaign_id, sha256=push.hashes[file.name], **said))
    outcomes = push.client.push_each(uploads, on_progress=push.listener.on_progress) if uploads else []
    for file, outcome in zip(files, outcomes, strict=True):
        if isinstance(outcome, Exception):
            push.errors[file.name] = str(outcome)
            continue
        push.frames[outcome.sha256] = outcome.id
        push.jobs.append(outcome.job_id)
    return sum(isinstance(outcome, records.Frame) for outcome in outcomes)


def _wait_until_read(push: _Push) -> dict[str, records.Frame]:
    """The frames of this push, by id, when nothing of them is being computed, or nobody computes it."""
    total = len(push.jobs)
    for number, job_id in enumerate(push.jobs, start=1):
        with suppress(problem.JobFailed):  # the frame's verdict says it
            push.client.wait(job_id)
        push.listener.on_count("read", number, total)
    wanted = set(push.frames.values())
    least, patient_until = len(wanted) + 1, 0.0
    while True:
        found = {frame.id: frame for frame in push.client.frames(push.campaign_id) if frame.id in wanted}
        pending = (frame for frame in found.values() if frame.outcome == "pending")
        unread = sum(any(reason.code in _UNREAD for reason in frame.reasons) for frame in pending)
        if unread < least:
            least, patient_until = unread, time.monotonic() + _PATIENCE_S
        if not unread or time.monotonic() > patient_until:
            return found
        time.sleep(_POLL_S)


def _tell(push: _Push, file: FieldFile, frames: dict[str, records.Frame]) -> Told:
    sha256 = push.hashes.get(file.name, "")
    frame_id = push.frames.get(sha256, "")
    frame = frames.get(frame_id)
    if not frame_id:
        # of the same content one was sent in the place of all
        same = (name for name, each in push.hashes.items() if each == sha256 and name in push.errors)
        reason = push.errors.get(file.name) or push.errors.get(next(same, ""), "it was not sent")
        return Told.unsent(file.name, reason, sha256)
    reasons: tuple[records.Reason, ...] = () if frame is None else frame.reasons
    note = push.notes.get(file.name)
    return Told(
        name=file.name,
        sha256=sha256,
        frame_id=frame_id,
        outcome="pending" if frame is None else frame.outcome,
        reasons=tuple(reason.detail for reason in reasons) + ((note,) if note else ()),
        codes=tuple(reason.code for reason in reasons),
    )


def _words(role: str, scene: str | None) -> str:
    return f"{role} of {scene}" if scene else role


def as_json(report: Report) -> dict[str, Any]:
    files = [{name: value for name, value in asdict(file).items() if value != ""} for file in report.files]
    counts = {"expected": len(report.files), "received": report.received, "sent": report.sent}
    lists = {"outcomes": report.outcomes, "files": files, "left_out": report.left_out}
    written = {"receipt": report.receipt} if report.receipt else {}
    return {"campaign_id": report.campaign_id, **counts, **lists, **written}
