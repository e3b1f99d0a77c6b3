"""Files on their way in pieces: a head that says what each will be and how far it is, and its bytes."""

import fcntl
import hashlib
import json
import os
import secrets
import struct
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict
from io import FileIO
from pathlib import Path
from typing import Final, Self

from radiometry.records import Record
from store.blobs.spool import disk_errors_named, sync_folder
from store.settings import Settings

LASTS_S: Final = 7 * 24 * 3600
_HEAD_BYTES: Final = 64 << 10
_READ_BYTES: Final = (4 << 10, *(_HEAD_BYTES,) * 9)
_STATE: Final = struct.Struct("<Q16sI")
_MOST_READ: Final = 1 << 20
_DONE: Final = "done"
_ROOM_FOR_FRAME: Final = 1 << 10


class Superseded(Exception):  # noqa: N818  it says what was found
    """Another connection has taken the upload over."""


class OtherOffset(Exception):  # noqa: N818  it says what was found
    """A piece does not begin where the durable bytes end."""

    def __init__(self, durable_bytes: int) -> None:
        super().__init__(str(durable_bytes))
        self.durable_bytes = durable_bytes


class FactsTooLong(Exception):  # noqa: N818  it says what was found
    """More was said of the file than its head holds."""


class Facts(Record):
    organisation_id: str
    key_id: str
    campaign_id: str
    size_bytes: int
    sha256: str | None  # of the whole file, where it was stated
    said: dict[str, str]  # of the frame, as its sender wrote it
    expires_at: float
    frame_id: str = ""  # once it is one
    job_id: str = ""  # reads that frame


class Partials:
    """The uploads below one folder, which processes of one machine may share."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    @classmethod
    def of(cls, settings: Settings) -> Self:
        return cls(settings.data / "uploads")

    def begin(self, token: str, facts: Facts) -> "Partial":
        """Make an upload under this token, or find the one that it has under way."""
        path = self._path(token, facts.organisation_id)
        draft = path.with_name(f".{secrets.token_hex(8)}")
        text = json.dumps(asdict(facts)).encode()
        if len(text) > _HEAD_BYTES - _ROOM_FOR_FRAME - _STATE.size:
            raise FactsTooLong
        with disk_errors_named(self._folder):
            path.parent.mkdir(parents=True, exist_ok=True)
            try:
                draft.touch(mode=0o600)
                with draft.open("r+b") as file:
                    file.write(_STATE.pack(0, b"", len(text)) + text)
                    file.flush()
                    os.fsync(file.fileno())
                if not self.is_under_way(token, facts.organisation_id):
                    Partial(path).remove()
                # of two that come at once with one token, the second finds the first one's
                with suppress(FileExistsError):
                    path.hardlink_to(draft)
                sync_folder(path.parent)
            finally:
                draft.unlink(missing_ok=True)
        return Partial(path)

    def find(self, token: str, organisation_id: str) -> "Partial | None":
        """Return the upload of this token unless it has ended."""
        partial = Partial(self._path(token, organisation_id))
        with suppress(FileNotFoundError):
            if partial.read_facts().expires_at > time.time():
                return partial
        return None

    def is_under_way(self, token: str, organisation_id: str) -> bool:
        known = self.find(token, organisation_id)
        return known is not None and not known.read_facts().frame_id

    def count(self, organisation_id: str) -> int:
        return sum(1 for _ in self._under_way(organisation_id))

    def list_facts(self, organisation_id: str) -> list[Facts]:
        found = []
        for partial in self._under_way(organisation_id):
            with suppress(FileNotFoundError):
                found.append(partial.read_facts())
        return [facts for facts in found if facts.expires_at > time.time()]

    def sweep(self) -> int:
        removed = 0
        for partial in (*self._under_way("*"), *self._under_way(f"*/{_DONE}")):
            with suppress(FileNotFoundError):
                if partial.read_facts().expires_at <= time.time():
                    partial.remove()
                    removed += 1
        return removed

    def _under_way(self, folder: str) -> Iterator["Partial"]:
        for path in self._folder.glob(f"{folder}/[!.]*"):
            if path.name != _DONE:
                yield Partial(path)

    def _path(self, token: str, organisation_id: str) -> Path:
        return self._folder / organisation_id / hashlib.sha256(token.encode()).hexdigest()


class Partial:
    def __init__(self, path: Path) -> None:
        self._begun = path

    @property
    def _path(self) -> Path:
        # a finished one lies apart: it is asked for a few times, and counted never again
        done = self._begun.parent / _DONE / self._begun.name
        return done if done.exists() else self._begun

    def _open(self) -> FileIO:
        try:
            return self._path.open("r+b", buffering=0)
        except FileNotFoundError:
            # it was finished just then
            return self._path.open("r+b", buffering=0)

    def read_facts(self) -> Facts:
        with self._open() as file:
            for most in _READ_BYTES:
                head = os.pread(file.fileno(), most, 0)
                _, _, length = _STATE.unpack(head[: _STATE.size])
                # longer than was read, or it becomes a frame at this moment
                with suppress(ValueError):
                    return Facts(**json.loads(head[_STATE.size : _STATE.size + length]))
        raise RuntimeError(f"the head of {self._path} cannot be read")

    def read_offset(self) -> int:
        with self._open() as file:
            return _read_state(file.fileno())[0]

    def claim(self, begins: int | None = None) -> "Claim":
        """Take the upload over from whoever writes it; ``begins``: unless another count is durable."""
        return Claim(self._path, begins)

    @contextmanager
    def whole(self) -> Iterator[tuple[Facts, Iterator[bytes]]]:
        """Lend the bytes that have arrived, in order; nobody else changes or borrows them meanwhile."""
        with self._locked() as file:
            file.seek(_HEAD_BYTES)
            yield self.read_facts(), iter(lambda: file.read(_MOST_READ), b"")

    def become(self, frame_id: str, job_id: str = "") -> None:
        """Note the frame that it has become and the job that reads it, and keep no byte of it."""
        with self._locked() as file:
            facts = self.read_facts()
            text = json.dumps(asdict(facts) | {"frame_id": frame_id, "job_id": job_id}).encode()
            os.pwrite(file.fileno(), _STATE.pack(facts.size_bytes, b"", len(text)) + text, 0)
            file.truncate(_HEAD_BYTES)
            done = self._begun.parent / _DONE
            done.mkdir(exist_ok=True)
            with suppress(FileNotFoundError):
                self._begun.rename(done / self._begun.name)

    def restart(self) -> None:
        """Forget what has arrived; only while its bytes are borrowed."""
        with self._open() as file:
            _write_state(file.fileno(), 0, b"")
            file.truncate(_HEAD_BYTES)

    @contextmanager
    def _locked(self) -> Iterator[FileIO]:
        with self._open() as file:
            fcntl.flock(file, fcntl.LOCK_EX)
            yield file

    def remove(self) -> None:
        self._path.unlink(missing_ok=True)


class Claim:
    """The right to append, until another claim: a connection that died unnoticed keeps nobody waiting."""

    def __init__(self, path: Path, begins: int | None) -> None:
        self._folder = path.parent
        self._fd = os.open(path, os.O_RDWR)
        self._name = secrets.token_bytes(16)
        with self._locked():
            self.durable_bytes, _ = _read_state(self._fd)
            if begins in {None, self.durable_bytes}:
                _write_state(self._fd, self.durable_bytes, self._name)
                self.written_bytes = self.durable_bytes
                return
        os.close(self._fd)
        raise OtherOffset(self.durable_bytes)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self._fd)

    def write(self, chunks: Sequence[bytes]) -> None:
        """Append; nothing of it counts before `keep`."""
        with self._locked(), disk_errors_named(self._folder):
            self._check()
            for chunk in chunks:
                rest = memoryview(chunk)
                while rest:
                    written = os.pwrite(self._fd, rest, _HEAD_BYTES + self.written_bytes)
                    rest = rest[written:]
                    self.written_bytes += written

    def keep(self) -> None:
        """Make all that was written durable: the bytes first, then how many they are."""
        if self.written_bytes == self.durable_bytes:
            return
        with self._locked(), disk_errors_named(self._folder):
            self._check()
            try:
                os.fdatasync(self._fd)
                _write_state(self._fd, self.written_bytes, self._name)
                os.fdatasync(self._fd)
            except OSError:
                # the next sync may succeed without these bytes: they are to be sent again
                _write_state(self._fd, self.durable_bytes, self._name)
                self.written_bytes = self.durable_bytes
                raise
        self.durable_bytes = self.written_bytes

    def _check(self) -> None:
        offset, name = _read_state(self._fd)
        if name != self._name or offset != self.durable_bytes:
            raise Superseded

    @contextmanager
    def _locked(self) -> Iterator[None]:
        fcntl.flock(self._fd, fcntl.LOCK_EX)
        try:
            yield
        finally:
            fcntl.flock(self._fd, fcntl.LOCK_UN)


def _read_state(fd: int) -> tuple[int, bytes]:
    offset, name, _ = _STATE.unpack(os.pread(fd, _STATE.size, 0))
    return offset, name


def _write_state(fd: int, offset: int, name: bytes) -> None:
    os.pwrite(fd, _STATE.pack(offset, name, 0)[: _STATE.size - 4], 0)
