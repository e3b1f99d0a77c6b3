"""Health of the service: what it depends on is checked in threads of its own, and never for long."""

import asyncio
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

from sqlalchemy import delete
from sqlalchemy.exc import SQLAlchemyError

from radiometry.findings import Finding as Entry
from radiometry.findings import interface
from store.blobs import Blobs, StorageFull, StorageUnavailable
from store.database import Database, SchemaDiffers, require_own_schema
from store.files import count_damaged
from store.jobs.processes import Part, list_parts
from store.tables import PartRow

ANSWER_WITHIN_S = 1.5
_SILENT_AFTER_S = 2.5
"""Later than `ANSWER_WITHIN_S`: on a busy machine a single look may take longer than a request may wait."""
_FRESH_S = 1.0
_TRUSTED_FOR_S = 5.0
"""How long what was found is held against a look that is slow."""
_WRITE_WITHIN_S = 10.0
"""Others may hold SQLite's write lock for a while, and nothing is wrong."""
_NOBODY = ""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """Result of one check, or that it has not come back."""

    name: str
    code: Entry | None = None
    detail: str = ""
    slow_s: float = 0.0
    """How long the present look has taken, where that is longer than it should."""


@dataclass(frozen=True, kw_only=True)
class Report:
    findings: list[Finding]
    parts: list[Part]
    damaged_files: int

    @property
    def unfit(self) -> Finding | None:
        """The first reason for which requests cannot be served."""
        return next((finding for finding in self.findings if finding.code is not None), None)

    @property
    def warnings(self) -> list[str]:
        """Return what is wrong while requests can be served: what they ask for waits."""
        at_work = {part.kind for part in self.parts if part.state == "working"}
        return [
            *([] if "worker" in at_work else ["no worker is at work: jobs wait"]),
            *(f"a {part.kind} hangs" for part in self.parts if part.state == "hung"),
            *(
                f"the check of {finding.name} has taken {finding.slow_s:.1f} s so far"
                for finding in self.findings
                if finding.slow_s
            ),
            *([f"stored files damaged or missing: {self.damaged_files}"] if self.damaged_files else []),
        ]


class _Check:
    """One thing to look at: at most one look is under way, however many ask and however long it takes."""

    def __init__(
        self,
        name: str,
        code: Entry,
        detail: str,
        look: Callable[[], Any],
        *,
        within_s: float = _SILENT_AFTER_S,
    ) -> None:
        self.name = name
        self._code = code
        self._detail = detail
        self._look = look
        self._within_s = within_s
        self._under_way: Future[Any] | None = None
        self._begun = self._ended = -_FRESH_S
        self._finding = Finding(name=name, code=code, detail="It has not answered yet.")
        self.found: Any = None

    def begin(self, pool: ThreadPoolExecutor) -> Future[Any] | None:
        """Start a check unless its answer is known or pending; return the checks that are pending."""
        self._take()
        if self._under_way is None and time.monotonic() - self._ended >= _FRESH_S:
            self._begun = time.monotonic()
            self._under_way = pool.submit(self._try)
        return self._under_way

    def finding(self) -> Finding:
        """Return what is known now: of a look that is merely slow, what the one just before it found."""
        self._take()
        asked_s = time.monotonic() - self._begun
        if self._under_way is None or asked_s < ANSWER_WITHIN_S:
            return self._finding
        # one that may take long says nothing by being slow; of any other only what was found lately counts
        known = self._within_s > _SILENT_AFTER_S or time.monotonic() - self._ended < _TRUSTED_FOR_S
        if asked_s < self._within_s and known:
            return replace(self._finding, slow_s=asked_s)
        return Finding(name=self.name, code=self._code, detail=f"It has not answered for {asked_s:.0f} s.")

    def _try(self) -> Any:  # noqa: ANN401
        """Return what is found; an expected error too, since nobody may be left who would hear of it."""
        try:
            return self._look()
        except (SQLAlchemyError, StorageFull, StorageUnavailable, OSError) as error:
            return error
        finally:
            # not when it is taken: that may be long after
            self._ended = time.monotonic()

    def _take(self) -> None:
        if self._under_way is None or not self._under_way.done():
            return
        found = self._under_way.result()
        if isinstance(found, SchemaDiffers):
            detail = f"{str(found).capitalize()}."
            self._finding = Finding(name=self.name, code=interface.SCHEMA_MISMATCH, detail=detail)
        elif isinstance(found, Exception):
            self._finding = Finding(name=self.name, code=self._code, detail=self._detail)
        else:
            self.found = found
            self._finding = Finding(name=self.name)
        self._under_way = None


class Health:
    """The checks, and what they last found. All of it but the looks themselves runs in the event loop."""

    def __init__(self, database: Database, blobs: Blobs) -> None:
        self._database = database
        no_database, no_files = interface.DATABASE_UNAVAILABLE, interface.STORAGE_UNAVAILABLE
        self._read = _Check(
            "database",
            no_database,
            "The database does not answer.",
            self._look_at_rows,
        )
        self._write = _Check(
            "writing",
            no_database,
            "The database takes no writes.",
            self._try_a_write,
            within_s=_WRITE_WITHIN_S,
        )
        self._files = _Check("files", no_files, "The file store takes no files.", blobs.check)
        self._checks = [self._read, self._write, self._files]
        self._pool = ThreadPoolExecutor(len(self._checks), thread_name_prefix="health")

    async def look(self) -> Report:
        """Return within two seconds what is known by then."""
        looks = [look for check in self._checks if (look := check.begin(self._pool)) is not None]
        if looks:
            await asyncio.wait([asyncio.wrap_future(look) for look in looks], timeout=ANSWER_WITHIN_S)
        findings = [check.finding() for check in self._checks]
        parts, damaged_files = self._read.found or ([], 0)
        return Report(findings=findings, parts=parts, damaged_files=damaged_files)

    def _look_at_rows(self) -> tuple[list[Part], int]:
        with self._database.reading() as session:
            require_own_schema(session)
            return list_parts(session), sum(count_damaged(session).values())

    def _try_a_write(self) -> None:
        """Go the way of a write up to the rows: a server that only reads, or a held lock, stops it."""
        with self._database.writing("health") as session:
            session.execute(delete(PartRow).where(PartRow.id == _NOBODY))
