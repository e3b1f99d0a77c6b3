"""Can a backup be restored? ``python -m verify.backup FOLDER`` proves its database and its files.

The backup is only read: its database is copied to a temporary folder and brought to this code's schema there,
as a restore would. Every stored file is read as a whole and must hash to its name.
"""

import argparse
import shutil
import sqlite3
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Final

from sqlalchemy import or_, select
from sqlalchemy.exc import SQLAlchemyError

from radiometry.records import Record
from store import migrate
from store.audit_check import check_audit
from store.blobs import BlobDamaged, Blobs, StorageUnavailable, blobs_from_url
from store.database import Database, SchemaDiffers, require_own_schema
from store.tables import Blob, IssuedCertificate
from verify.audit import check_rows

_DATABASE: Final = "stilb.sqlite"
_MOST_LINES: Final = 50


class Proven(Record):
    """Files that were read whole, and what is wrong."""

    files: int = 0
    size_bytes: int = 0
    faults: tuple[str, ...] = ()


class _Unusable(Exception):  # noqa: N818  it says what was found
    """Nothing more can be said of this backup."""


def check_backup(folder: Path, *, database_url: str = "", blobs_url: str = "") -> Proven:
    """Prove a backup: a copied SQLite database, or a restored one at an address, and the files it names."""
    with ExitStack() as stack:
        try:
            if not database_url:
                copy = stack.enter_context(tempfile.TemporaryDirectory(prefix="stilb-backup-"))
                database_url = f"sqlite:///{_copy_database(folder, Path(copy))}"
            database = Database(database_url, answer_within_s=None)
            stack.callback(database.dispose)
            if database.is_sqlite:
                migrate.migrate(database)
            with database.reading() as session:
                require_own_schema(session)
            _, fault = check_audit(database)
            if fault is not None:
                rows = [f"the audit trail is broken at entry {fault.seq}: {fault.what}"]
            else:
                rows = check_rows(database).faults
        except (_Unusable, SchemaDiffers) as found:
            return Proven(faults=(f"the database: {found}",))
        except (SQLAlchemyError, sqlite3.Error) as error:
            return Proven(faults=(f"the database cannot be read: {str(error).partition(chr(10))[0]}",))
        blobs = blobs_from_url(blobs_url or str(folder / "blobs"), folder)
        return _check_files(database, blobs, rows)


def _copy_database(folder: Path, target: Path) -> Path:
    source, copy = folder / _DATABASE, target / _DATABASE
    if not source.is_file():
        raise _Unusable(f"there is no {source}; DATABASE=<address> names a restored PostgreSQL")
    for path in (source, source.with_name(f"{_DATABASE}-wal")):
        if path.exists():
            shutil.copyfile(path, target / path.name)
    with closing(sqlite3.connect(copy)) as connection:
        found = [row[0] for row in connection.execute("PRAGMA integrity_check(5)")]
        tables = {row[0] for row in connection.execute("SELECT name FROM sqlite_master")}
    if found != ["ok"]:
        raise _Unusable(f"it is cut or damaged: {'; '.join(found)}")
    if "blob" not in tables:
        raise _Unusable("it is empty, or none of stilb's")
    return copy


def _check_files(database: Database, blobs: Blobs, found: list[str]) -> Proven:
    files = size_bytes = 0
    for sha256, size in _list_files(database):
        try:
            blobs.prove(sha256, lambda _size: None)
        except BlobDamaged as damage:
            found.append(f"the file {sha256}{_name_certificate(database, sha256)} is {damage.damage}")
            continue
        except StorageUnavailable as error:
            return Proven(files=files, size_bytes=size_bytes, faults=(*found, str(error)))
        files, size_bytes = files + 1, size_bytes + size
    return Proven(files=files, size_bytes=size_bytes, faults=tuple(found))


def _name_certificate(database: Database, sha256: str) -> str:
    """Return which issued certificate a file is, in words; "" for any other file."""
    mine = or_(IssuedCertificate.json_sha256 == sha256, IssuedCertificate.pdf_sha256 == sha256)
    with database.reading() as session:
        number = session.scalar(select(IssuedCertificate.number).where(mine).limit(1))
    return f" of certificate {number}" if number else ""


def _list_files(database: Database) -> Iterator[tuple[str, int]]:
    """Yield every stored file's name and size, a page at a time: each takes a while to read."""
    after = ""
    while True:
        rows = select(Blob.sha256, Blob.size_bytes).where(Blob.sha256 > after).order_by(Blob.sha256)
        with database.reading() as session:
            page = [(row[0], row[1]) for row in session.execute(rows.limit(1000))]
        if not page:
            return
        yield from page
        after = page[-1][0]


def main(arguments: list[str] | None = None) -> int:
    """Check, print what was proven, give the exit code."""
    parser = argparse.ArgumentParser(prog="stilb-server verify-backup", description=__doc__)
    parser.add_argument("folder", type=Path, help="with stilb.sqlite and blobs/, see docs/operations.md")
    parser.add_argument("--database", default="", help="of a restored PostgreSQL, in place of stilb.sqlite")
    parser.add_argument("--blobs", default="", help="a folder or s3:// address, in place of blobs/")
    asked = parser.parse_args(arguments)
    if not asked.folder.is_dir():
        print(f"stilb: there is no folder {asked.folder}", file=sys.stderr)  # noqa: T201
        return 1
    proven = check_backup(asked.folder, database_url=asked.database, blobs_url=asked.blobs)
    for line in proven.faults[:_MOST_LINES]:
        print(f"stilb: {line}", file=sys.stderr)  # noqa: T201
    if len(proven.faults) > _MOST_LINES:
        print(f"stilb: and {len(proven.faults) - _MOST_LINES} more", file=sys.stderr)  # noqa: T201
    print(f"proven: {proven.files} files, {proven.size_bytes / 1e6:.1f} MB")  # noqa: T201
    print(f"this backup is {'NOT ' if proven.faults else ''}whole")  # noqa: T201
    return int(bool(proven.faults))


if __name__ == "__main__":
    sys.exit(main())
