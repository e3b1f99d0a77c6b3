"""The series of coefficients: of every version in force, from its ready rows."""

from collections.abc import Iterator, Sequence
from contextlib import closing
from datetime import datetime
from typing import Any, ClassVar

from sqlalchemy import Select, func, select, tuple_
from sqlalchemy.orm import Session

from store.columns import utc_now
from store.database import Database, read_plainly
from store.ready import series
from store.ready.publications import write_instant
from store.ready.records import read_records, write_record
from store.ready.series import PAGE, Asked, Key, Page
from store.tables import Camera, ReadyCells, ReadyRow

_MOST_PLACES = 1 << 31
_VERSIONS = 1000


class CoefficientSeries:
    """Every coefficient of every version in force at some time, by camera, time and method, as known now."""

    _KEY: ClassVar[tuple[Any, ...]] = (
        ReadyRow.camera_id,
        ReadyRow.valid_from,
        ReadyRow.method,
        ReadyRow.publication_id,
    )

    def __init__(self, database: Database, asked: Asked) -> None:
        self._database = database
        self._asked = asked

    def is_place(self, key: Key) -> bool:
        return (
            len(key) == 5
            and all(map(series.is_plain, key[:4]))
            and series.is_instant(key[1])
            and type(key[4]) is int
            and -1 <= key[4] < _MOST_PLACES
        )

    def read_state(self, session: Session) -> str:
        return series.read_state(session, self._asked.organisation_id)

    def find_end(self, session: Session, *, after: Key | None, limit: int) -> Key | None:
        known = self._read_known(session)
        total, more = 0, self._select(known, after, None)
        # most series end within the limit: one sum, instead of each version's place
        counts = more.with_only_columns(ReadyRow.coefficients).limit(limit + 1).subquery()
        versions, coefficients = session.execute(select(func.count(), func.sum(counts.c.coefficients))).one()
        if max(versions, coefficients or 0) <= limit:
            return None
        rows = more.with_only_columns(*self._KEY, ReadyRow.coefficients)
        with closing(session.execute(rows, execution_options={"yield_per": 1000})) as found:
            for *key, count in found:
                done = self._done(after, key)
                if total + count - done > limit:
                    return [key[0], write_instant(key[1]), *key[2:], done + limit - total - 1]
                total += count - done
        return None

    def read(self, *, after: Key | None, until: Key | None) -> Iterator[Page]:
        with self._database.reading() as session:
            known = self._read_known(session)
        while True:
            with self._database.reading() as session:
                found = read_plainly(session, self._select(known, after, until).limit(_VERSIONS))
                last = session.get_one(ReadyRow, found[-1][0]) if len(found) == _VERSIONS else None
            for some in _group(found):
                yield from self._read_cells(some, after, until)
            if last is None:
                return
            after = [last.camera_id, write_instant(last.valid_from), last.method, last.publication_id, None]

    def _read_known(self, session: Session) -> datetime:
        """Return now, or the last instant of knowledge if a clock that has been set back recorded that."""
        # of one camera: its rows alone, which its index finds
        mine = [
            ReadyRow.organisation_id == self._asked.organisation_id,
            *series.match_equal(ReadyRow, self._asked, "camera_id"),
        ]
        last = session.execute(
            select(func.max(ReadyRow.known_from), func.max(ReadyRow.known_to)).where(*mine)
        ).one()
        return max([utc_now(), *filter(None, last)])

    def _select(self, known: datetime, after: Key | None, until: Key | None) -> Select[Any]:
        asked, row = self._asked, ReadyRow
        where = [
            row.organisation_id == asked.organisation_id,
            row.known_from <= known,
            row.known_to.is_(None) | (row.known_to > known),
            *series.match_equal(row, asked, "camera_id", "method", "campaign_id"),
            *series.match_between(row.computed_at, asked.computed_start, asked.computed_end),
        ]
        if asked.start is not None:
            where.append(row.valid_to.is_(None) | (row.valid_to > asked.start))
        if asked.end is not None:
            where.append(row.valid_from < asked.end)
        # of one camera: its rows alone, in the order of their index
        first = 0 if asked.camera_id is None else 1
        order = self._KEY[first:]
        if after is not None:
            place = series.bind_place(self._parse(after)[first:], order)
            # a version of which rows are missing comes again
            where.append(tuple_(*order) > place if after[4] is None else tuple_(*order) >= place)
        if until is not None:
            where.append(tuple_(*order) <= series.bind_place(self._parse(until)[first:], order))
        columns: tuple[Any, ...] = (row.publication_id, row.coefficients, row.camera_id)
        columns += (Camera.make, Camera.model, Camera.serial)
        return select(*columns).join(Camera, Camera.id == row.camera_id).where(*where).order_by(*order)

    def _parse(self, key: Key) -> tuple[Any, ...]:
        return key[0], series.read_instant(key[1]), key[2], key[3]

    def _done(self, after: Key | None, key: Sequence[Any]) -> int:
        """Return how many rows of a version lie before the place to begin at."""
        return after[4] + 1 if after and after[4] is not None and self._parse(after)[3] == key[3] else 0

    def _read_cells(self, publications: list[Any], after: Key | None, until: Key | None) -> Iterator[Page]:
        ids = [each[0] for each in publications]
        wanted = select(ReadyCells.publication_id, ReadyCells.cells)
        with self._database.reading() as session:
            cells = dict(read_plainly(session, wanted.where(ReadyCells.publication_id.in_(ids))))
        records: list[str] = []
        for each, _, *camera in publications:
            head = write_record(camera)
            rows = [f"{head},{row}" for row in read_records(cells[each])]
            # a series ends within its last version, and begins within its first one
            if until is not None and each == until[3]:
                del rows[until[4] + 1 :]
            if after is not None and each == after[3]:
                del rows[: after[4] + 1]
            records += rows
        return series.cut(records)


def _group(publications: list[Any]) -> Iterator[list[Any]]:
    """Group publications so that the rows of a group are read at once, or those of one long version."""
    group: list[Any] = []
    count = 0
    for publication in publications:
        if group and count + publication[1] > PAGE:
            yield group
            group, count = [], 0
        group.append(publication)
        count += publication[1]
    if group:
        yield group
