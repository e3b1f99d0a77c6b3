"""Stored files as the database knows them: read only through their proof, marked where it fails, healed."""

import io
import logging
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from datetime import datetime
from itertools import chain
from typing import Final

from PIL import Image
from sqlalchemy import func, select
from sqlalchemy.orm import Session

from radiometry.findings import interface
from store import audit, jobs
from store.blobs import BlobDamaged, BlobMissing, Blobs, Damage, StorageUnavailable, StoredBlob, StoredFile
from store.database import Database
from store.queries.usage import add_jobs
from store.tables import Blob, Job, SmallPreview, insert_or_not, utc_now

log = logging.getLogger(__name__)

_ACTOR: Final = "files"
SCRUB_DAYS: Final = 30.0  # each file is proven once in this time, whether it is read or not


class Files:
    """The blobs of one service; every method may be called from any thread."""

    def __init__(self, database: Database, blobs: Blobs) -> None:
        self._database, self._blobs = database, blobs

    def open(self, sha256: str) -> tuple[int, Iterator[bytes]]:
        """Return a file's size and its proven bytes; the first MiB is proven before this returns."""
        blob = self._find(sha256)
        pieces = self._marked(blob)
        first = next(pieces, b"")
        return blob.size_bytes, chain([first], pieces)

    @contextmanager
    def local(self, sha256: str) -> Iterator[StoredFile]:
        """Lend a real file; BlobDamaged that its reader raises within marks it."""
        blob = self._find(sha256)
        with self._marking(), self._blobs.local_file(blob) as file:
            yield file

    def prove(self, sha256: str, pace: Callable[[int], object] = lambda _size: None) -> StoredBlob:
        """Read all of a file where it is kept: mark it if it is damaged, heal it if it is whole."""
        with self._marking():
            blob = self._blobs.prove(sha256, pace)
        self._keep(blob)
        return blob

    def heal(self, blob: StoredBlob) -> None:
        """End the damage of a file whose bytes have just been stored again, if it was damaged."""
        with self._database.reading() as session:
            row = session.get(Blob, blob.sha256)
        if row is not None and row.damage is not None:
            self._keep(blob)

    def _keep(self, blob: StoredBlob) -> None:
        with self._database.writing(_ACTOR) as session:
            row = session.get_one(Blob, blob.sha256, with_for_update=True)
            _keep_whole(session, row, blob)

    def find_absent(self, sizes: Mapping[str, int]) -> set[str]:
        """Return which files are damaged or not there, and mark those that are found missing."""
        known = select(Blob.sha256).where(Blob.sha256.in_(sizes), Blob.damage.is_not(None))
        with self._database.reading() as session:
            damaged = set(session.scalars(known))
        began = utc_now()
        absent = self._blobs.find_absent({name: size for name, size in sizes.items() if name not in damaged})
        for sha256 in absent:
            self._mark(sha256, "missing", since=began)
        return damaged | absent

    def _find(self, sha256: str) -> StoredBlob:
        columns = select(Blob.size_bytes, Blob.digests, Blob.damage).where(Blob.sha256 == sha256)
        with self._database.reading() as session:
            size_bytes, digests, damage = session.execute(columns).one()
        if damage is not None:
            raise BlobMissing(sha256) if damage == "missing" else BlobDamaged(sha256)
        if digests is None:
            return self.prove(sha256)
        return StoredBlob(sha256, size_bytes, digests)

    def _marked(self, blob: StoredBlob) -> Iterator[bytes]:
        with self._marking():
            yield from self._blobs.open(blob)

    @contextmanager
    def _marking(self) -> Iterator[None]:
        began = utc_now()
        try:
            yield
        except BlobDamaged as found:
            if not self._mark(found.sha256, found.damage, since=began):
                raise StorageUnavailable(f"the stored file {found.sha256} was replaced meanwhile") from found
            raise

    def _mark(self, sha256: str, damage: Damage, *, since: datetime) -> bool:
        """Mark a file, unless it was stored again since it was read; whether what was found still holds."""
        with self._database.writing(_ACTOR) as session:
            row = session.get(Blob, sha256, with_for_update=True)
            if row is not None and row.damage is None and since <= row.proven_at <= utc_now():
                return False
            if row is not None and row.damage != damage:
                log.error("the stored file %s is %s", sha256, damage)
                _change_damage(session, row, damage)
        return True


def keep_blobs(session: Session, blobs: Iterable[StoredBlob]) -> set[str]:
    """Add the rows of stored files, some perhaps the same; return the new hashes. Others are whole again."""
    stored = {blob.sha256: blob for blob in blobs}
    # in one order, so that two who bring the same files do not wait for each other
    rows = [vars(stored[sha256]) for sha256 in sorted(stored)]
    # the same words however many there are: a list of values would be compiled each time
    added = insert_or_not(session, Blob).on_conflict_do_nothing().returning(Blob.sha256)
    new = {*session.connection().execute(added, rows).scalars()} if rows else set()
    if known := stored.keys() - new:
        locked = select(Blob).where(Blob.sha256.in_(known)).order_by(Blob.sha256).with_for_update()
        for row in session.scalars(locked, execution_options={"populate_existing": True}):
            _keep_whole(session, row, stored[row.sha256])
        session.flush()
    return new


def describe_damage(damage: BlobDamaged) -> str:
    return (
        f"The stored file {damage.sha256} is {damage.damage}: the service's disk lost what was uploaded, and "
        "nothing of it is handed out. Upload the same file again: jobs that wait for it then go on."
    )


def count_damaged(session: Session) -> dict[str, int]:
    counts = select(Blob.damage, func.count()).where(Blob.damage.is_not(None)).group_by(Blob.damage)
    return {str(row[0]): row[1] for row in session.execute(counts)}


def find_proof_age_s(session: Session) -> float:
    """Return how long ago the file was proven that has waited longest since [s]; 0 without whole files."""
    whole = select(Blob.proven_at).where(Blob.damage.is_(None))
    oldest = session.scalar(whole.order_by(Blob.proven_at).limit(1))
    return (utc_now() - oldest).total_seconds() if oldest else 0.0


def _keep_whole(session: Session, row: Blob, blob: StoredBlob) -> None:
    """Note that all of a file has just been proven; whatever failed for its damage goes on."""
    row.digests, row.proven_at = blob.digests, utc_now()
    if row.damage is not None:
        _change_damage(session, row, None)
        # a job names the file that it lacked in its error
        for_its_damage = Job.error["code"].as_string() == interface.STORED_FILE_DAMAGED
        if retried := jobs.retry(session, for_its_damage & (Job.error["sha256"].as_string() == blob.sha256)):
            add_jobs(session, retried)


def _change_damage(session: Session, row: Blob, damage: Damage | None) -> None:
    before, row.damage = row.damage, damage
    audit.record_act(session, "damage" if damage else "heal", row, {"damage": before}, {"damage": damage})


SIDE_PX: Final = 160


def reduce_preview(preview: bytes) -> bytes:
    """Return a frame's preview as WebP of at most 160 px, some 3 kB."""
    with Image.open(io.BytesIO(preview)) as opened:
        grey = opened.convert("L")
    grey.thumbnail((SIDE_PX, SIDE_PX), reducing_gap=2.0)
    out = io.BytesIO()
    grey.save(out, "WEBP", quality=80, method=2)
    return out.getvalue()


def find_small_previews(session: Session, hashes: Collection[str]) -> dict[str, bytes]:
    columns = select(SmallPreview.preview_sha256, SmallPreview.webp)
    rows = session.execute(columns.where(SmallPreview.preview_sha256.in_(hashes)))
    return {row[0]: row[1] for row in rows}


def keep_small_previews(session: Session, pictures: Mapping[str, bytes]) -> None:
    """Keep pictures by the hash of their preview, unless somebody else has done so."""
    rows = [{"preview_sha256": sha256, "webp": pictures[sha256]} for sha256 in sorted(pictures)]
    session.execute(insert_or_not(session, SmallPreview).values(rows).on_conflict_do_nothing())
