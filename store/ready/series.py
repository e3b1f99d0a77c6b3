"""Series: flat rows, read a page at a time by keyset; no connection is held between two pages."""

import csv
from collections.abc import Iterator, Sequence
from contextlib import closing
from datetime import UTC, datetime
from typing import Any, ClassVar

from sqlalchemy import ColumnElement, Select, func, literal, select, tuple_
from sqlalchemy.orm import Session

from radiometry.findings import shared
from radiometry.records import Record
from store.database import Database, read_plainly
from store.queries.calibrations import version_state
from store.ready.rows import BODY, COLUMNS, FLAGS, STATE, is_plain, read_records, write_instant, write_record
from store.tables import AuditEntry, Calibration, Camera, MeasuredRow, Measurement, ReadyCells, ReadyRow
from store.tables.audit import IN_SERIES
from store.tables.base import utc_now

Page = list[str]  # some rows, at least one, as `store.ready.rows` writes them
Key = list[Any]  # place of a row in the order of its series, as JSON has it

PAGE = 2000  # rows that are read at once
_ROWS = 250  # rows of a page: their cells stay in the processor's cache


class Asked(Record):
    """Which rows of an organisation."""

    organisation_id: str
    camera_id: str | None = None
    campaign_id: str | None = None
    calibration_id: str | None = None
    method: str | None = None
    start: datetime | None = None
    end: datetime | None = None
    computed_start: datetime | None = None
    computed_end: datetime | None = None


def cut(records: list[str]) -> Iterator[Page]:
    return (records[first : first + _ROWS] for first in range(0, len(records), _ROWS))


def match_equal(row: Any, asked: Asked, *names: str) -> Iterator[ColumnElement[bool]]:  # noqa: ANN401
    for name in names:
        if getattr(asked, name) is not None:
            yield getattr(row, name) == getattr(asked, name)


def match_between(column: Any, start: datetime | None, end: datetime | None) -> list[ColumnElement[bool]]:  # noqa: ANN401
    """Match a time from one instant on and before another one, as far as they are given."""
    return [*([column >= start] if start else []), *([column < end] if end else [])]


def bind_place(values: Sequence[Any], key: Sequence[Any]) -> Any:  # noqa: ANN401
    """Return a place as the tuple that the columns of a key are compared with."""
    return tuple_(*(literal(value, each.type) for value, each in zip(values, key, strict=True)))


def is_text(part: object) -> bool:
    """Return whether a part of a cursor is a text that can be asked for."""
    # PostgreSQL cannot even be asked for a NUL
    return isinstance(part, str) and part.isascii() and part.isprintable()


def is_instant(text: str) -> bool:
    """Return whether a text is an instant that a database holds."""
    try:
        return 1 < datetime.fromisoformat(text).astimezone(UTC).year < 9999
    except (ValueError, OverflowError):
        return False


def read_instant(text: str) -> datetime:
    return datetime.fromisoformat(text).astimezone(UTC)


def read_state(session: Session, organisation_id: str, *subjects: str) -> str:
    """Return what changes with cameras, decisions and these subjects: the hash of each one's last entry."""
    entry = AuditEntry
    of_each = [
        select(entry.sha256)
        .where(entry.organisation_id == organisation_id, IN_SERIES, entry.subject_type == subject)
        .order_by(entry.seq.desc())
        .limit(1)
        .scalar_subquery()
        for subject in ("camera", "publication", "revocation", *subjects)
    ]
    return " ".join(each or "" for each in session.execute(select(*of_each)).one())


_MOST_PLACES = 1 << 31
_VERSIONS = 1000


class _Series:
    def __init__(self, database: Database, asked: Asked) -> None:
        self._database, self._asked = database, asked


class CoefficientSeries(_Series):
    """Every coefficient of every version in force at some time, by camera, time and method, as known now."""

    _KEY: ClassVar[tuple[Any, ...]] = (
        *(ReadyRow.camera_id, ReadyRow.valid_from, ReadyRow.method, ReadyRow.publication_id),
    )

    def is_place(self, key: Key) -> bool:
        is_version = len(key) == 5 and all(map(is_text, key[:4])) and is_instant(key[1])
        return is_version and type(key[4]) is int and -1 <= key[4] < _MOST_PLACES

    def read_state(self, session: Session) -> str:
        """Return what changes whenever a row of the organisation is added or changes."""
        return read_state(session, self._asked.organisation_id)

    def find_end(self, session: Session, *, after: Key | None, limit: int) -> Key | None:
        """Return the place of the last row within the limit; None if no row follows it."""
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
                done = (
                    after[4] + 1 if after and after[4] is not None and self._parse(after)[3] == key[3] else 0
                )
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
            *match_equal(ReadyRow, self._asked, "camera_id"),
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
            *match_equal(row, asked, "camera_id", "method", "campaign_id"),
            *match_between(row.computed_at, asked.computed_start, asked.computed_end),
        ]
        if asked.start is not None:
            where.append(row.valid_to.is_(None) | (row.valid_to > asked.start))
        if asked.end is not None:
            where.append(row.valid_from < asked.end)
        # of one camera: its rows alone, in the order of their index
        first = 0 if asked.camera_id is None else 1
        order = self._KEY[first:]
        if after is not None:
            place = bind_place(self._parse(after)[first:], order)
            # a version of which rows are missing comes again
            where.append(tuple_(*order) > place if after[4] is None else tuple_(*order) >= place)
        if until is not None:
            where.append(tuple_(*order) <= bind_place(self._parse(until)[first:], order))
        columns: tuple[Any, ...] = (row.publication_id, row.coefficients, row.camera_id)
        columns += (Camera.make, Camera.model, Camera.serial)
        return select(*columns).join(Camera, Camera.id == row.camera_id).where(*where).order_by(*order)

    def _parse(self, key: Key) -> tuple[Any, ...]:
        return key[0], read_instant(key[1]), key[2], key[3]

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
        return cut(records)


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


State = tuple[int, str]  # number of a version, and what has become of it
_AFTER_FLAGS = len(COLUMNS) - FLAGS - 1
_BODY_AFTER = slice(BODY.start - FLAGS, BODY.stop - FLAGS)
STATE_FLAGS = {
    "draft": shared.CALIBRATION_NOT_PUBLISHED,
    "superseded": shared.CALIBRATION_SUPERSEDED,
    "revoked": shared.CALIBRATION_REVOKED,
}
"""Flag of what was measured with a version in this state."""


class MeasurementSeries(_Series):
    """Every measurement, by the time at which its frame was taken."""

    _ROW: ClassVar[Any] = MeasuredRow.__table__.c
    _KEY: ClassVar[tuple[Any, ...]] = (_ROW.taken_from, _ROW.measurement_id)

    def is_place(self, key: Key) -> bool:
        return len(key) == 2 and all(map(is_text, key)) and is_instant(key[0])

    def read_state(self, session: Session) -> str:
        return read_state(session, self._asked.organisation_id, "measurement")

    def find_end(self, session: Session, *, after: Key | None, limit: int) -> Key | None:
        last = self._select(after, None).with_only_columns(*self._KEY).offset(limit - 1).limit(2)
        found = session.execute(last).all()
        return [write_instant(found[0][0]), found[0][1]] if len(found) > 1 else None

    def read(self, *, after: Key | None, until: Key | None) -> Iterator[Page]:
        states: dict[str, State] = {}
        names: dict[str, str] = {}
        while True:
            with self._database.reading() as session:
                found = read_plainly(session, self._select(after, until).limit(PAGE))
                ids = {each for row in found for each in (row[1], row[2]) if each} - states.keys()
                states |= _read_states(session, ids)
                names |= _read_names(session, {row[3] for row in found} - names.keys())
                last = session.get_one(MeasuredRow, found[-1][0]) if len(found) == PAGE else None
            yield from cut(_settle(found, states, names))
            if last is None:
                return
            after = [write_instant(last.taken_from), last.measurement_id]

    def _select(self, after: Key | None, until: Key | None) -> Select[Any]:
        asked, row = self._asked, self._ROW
        where = [
            row.organisation_id == asked.organisation_id,
            *match_equal(row, asked, "camera_id", "campaign_id", "calibration_id"),
            *match_between(row.created_at, asked.computed_start, asked.computed_end),
        ]
        if asked.method is not None:
            of_method = select(Measurement.id).where(
                Measurement.id == row.measurement_id, Measurement.method == asked.method
            )
            where.append(of_method.exists())
        if asked.start is not None:
            # of a frame whose file names no time zone, any time that it may mean
            where += [row.taken_to >= asked.start]
        if asked.end is not None:
            where += [row.taken_from < asked.end, row.taken_to.is_not(None)]
        for key, is_after in ((after, True), (until, False)):
            if key is not None:
                place = bind_place((read_instant(key[0]), key[1]), self._KEY)
                where.append(tuple_(*self._KEY) > place if is_after else tuple_(*self._KEY) <= place)
        columns = (row.measurement_id, row.calibration_id, row.corrector_id, row.camera_id, row.cells)
        return select(*columns).where(*where).order_by(*self._KEY)


def _settle(rows: list[Any], states: dict[str, State], names: dict[str, str]) -> list[str]:
    """Return the records with what has become of their versions, and the names that the cameras have now."""
    records = []
    known: dict[tuple[str, str | None], tuple[str, str, list[str]]] = {}
    for _, of, corrector, camera, record in rows:
        if (of, corrector) not in known:
            version, state = states[of]
            stored = f",{of},{version},"
            # of what has become of the version, and of the one that corrected its frames
            raised = [STATE_FLAGS[state].code] if state in STATE_FLAGS else []
            if corrector is not None and states[corrector][1] == "revoked":
                raised.append(shared.CALIBRATION_REVOKED.code)
            known[of, corrector] = (f"{stored},", f"{stored}{state},", raised)
        stored, settled, raised = known[of, corrector]
        if is_plain(record):
            cells = record.replace(stored, settled, 1).rsplit(",", _AFTER_FLAGS)
            cells[_BODY_AFTER] = (names[camera],)
            if raised:
                before, _, flags = cells[0].rpartition(",")
                cells[0] = f"{before},{_join_flags(flags, raised)}"
            records.append(",".join(cells))
        else:
            (cells,) = csv.reader([record])
            cells[STATE], cells[FLAGS] = states[of][1], _join_flags(cells[FLAGS], raised)
            (cells[BODY],) = csv.reader([names[camera]])
            records.append(write_record(cells))
    return records


def _join_flags(flags: str, raised: list[str]) -> str:
    return " ".join(dict.fromkeys([*flags.split(), *raised]))


def _read_names(session: Session, camera_ids: set[str]) -> dict[str, str]:
    if not camera_ids:
        return {}
    columns = Camera.id, Camera.make, Camera.model, Camera.serial
    rows = session.execute(select(*columns).where(Camera.id.in_(camera_ids)))
    return {row[0]: write_record(row[1:]) for row in rows}


def _read_states(session: Session, calibration_ids: set[str]) -> dict[str, State]:
    if not calibration_ids:
        return {}
    wanted = select(Calibration.id, Calibration.version, version_state)
    rows = session.execute(wanted.where(Calibration.id.in_(calibration_ids)))
    return {row[0]: (row[1], row[2]) for row in rows}


Series = CoefficientSeries | MeasurementSeries  # rows of an organisation in a stable order
