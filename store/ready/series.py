"""Series: flat rows, read a page at a time by keyset; no connection is held between two pages."""

import csv
import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from itertools import chain, groupby, repeat
from operator import itemgetter
from typing import Any, ClassVar, Protocol

from sqlalchemy import ColumnElement, Select, Text, and_, case, cast, func, literal, select, tuple_
from sqlalchemy.orm import Session

from radiometry.findings import shared
from store.columns import utc_now
from store.database import Database
from store.ready.measurements import FLAGS, STATE
from store.ready.publications import write_instant
from store.tables import (
    Calibration,
    Camera,
    CoefficientRow,
    MeasuredRow,
    Measurement,
    Publication,
    ReadyRow,
    Revocation,
)

Page = list[Sequence[str]]
"""Some rows, column by column: cells as text; an absent one is empty."""
Key = list[Any]
"""Place of a row in the order of its series, as JSON has it."""

STATE_FLAGS = {
    "draft": shared.CALIBRATION_NOT_PUBLISHED,
    "superseded": shared.CALIBRATION_SUPERSEDED,
    "revoked": shared.CALIBRATION_REVOKED,
}
"""Flag of what was measured with a version in this state."""
_PAGE = 2000
_MOST_PLACES = 1 << 31
_VERSIONS = 200


@dataclass(frozen=True, kw_only=True)
class Asked:
    """Which rows of an organisation.

    Attributes
    ----------
    start, end : datetime or None
        Of coefficients the time in which they hold; of measurements the time at which the frame was taken.
    computed_start, computed_end : datetime or None
        When the version or the measurement was computed.
    """

    organisation_id: str
    camera_id: str | None = None
    campaign_id: str | None = None
    calibration_id: str | None = None
    method: str | None = None
    start: datetime | None = None
    end: datetime | None = None
    computed_start: datetime | None = None
    computed_end: datetime | None = None


class Series(Protocol):
    """Rows in a stable order."""

    def is_place(self, key: Key) -> bool:
        """Return whether a list from outside can be a place in this series."""

    def read_state(self, session: Session) -> str:
        """Return what changes whenever a row of the organisation is added or changes."""

    def find_end(self, session: Session, *, after: Key | None, limit: int) -> Key | None:
        """Return the place of the last row within the limit; None if no row follows it."""

    def read(self, *, after: Key | None, until: Key | None) -> Iterator[Page]:
        """Read the rows after one place up to another one."""


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
            and all(map(_is_plain, key[:4]))
            and _is_instant(key[1])
            and type(key[4]) is int
            and -1 <= key[4] < _MOST_PLACES
        )

    def read_state(self, session: Session) -> str:
        return _read_decisions(session, self._asked.organisation_id)

    def find_end(self, session: Session, *, after: Key | None, limit: int) -> Key | None:
        known = self._read_known(session)
        total, more = 0, self._select(known, after)
        for *key, count in session.execute(
            more.with_only_columns(*self._KEY, ReadyRow.coefficients), execution_options={"yield_per": 1000}
        ):
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
                found = list(session.execute(self._select(known, after).limit(_VERSIONS)))
            for some in _group(found):
                yield from self._read_values(some, after, until)
            if len(found) < _VERSIONS:
                return
            last = found[-1]
            after = [last.camera_id, write_instant(last.valid_from), last.method, last.publication_id, None]
            if until is not None and self._parse(after) >= self._parse(until):
                return

    def _read_known(self, session: Session) -> datetime:
        """Return now, or the last instant of knowledge if a clock that has been set back recorded that."""
        mine = ReadyRow.organisation_id == self._asked.organisation_id
        last = session.execute(
            select(func.max(ReadyRow.known_from), func.max(ReadyRow.known_to)).where(mine)
        ).one()
        return max([utc_now(), *filter(None, last)])

    def _select(self, known: datetime, after: Key | None) -> Select[Any]:
        asked, row = self._asked, ReadyRow
        where = [
            row.organisation_id == asked.organisation_id,
            row.known_from <= known,
            row.known_to.is_(None) | (row.known_to > known),
            *_equal(row, asked, "camera_id", "method", "campaign_id"),
            *_between(row.computed_at, asked.computed_start, asked.computed_end),
        ]
        if asked.start is not None:
            where.append(row.valid_to.is_(None) | (row.valid_to > asked.start))
        if asked.end is not None:
            where.append(row.valid_from < asked.end)
        if after is not None:
            place = _place(self._parse(after), self._KEY)
            # a version of which rows are missing comes again
            where.append(tuple_(*self._KEY) > place if after[4] is None else tuple_(*self._KEY) >= place)
        columns: tuple[Any, ...] = (
            *(row.publication_id, row.camera_id, Camera.make, Camera.model.label("model_name")),
            *(Camera.serial, row.method, row.version, row.calibration_id, row.campaign_id),
            *(row.valid_from, row.valid_to, row.computed_at, row.coefficients),
        )
        return select(*columns).join(Camera, Camera.id == row.camera_id).where(*where).order_by(*self._KEY)

    def _parse(self, key: Key) -> tuple[Any, ...]:
        return key[0], _read_instant(key[1]), key[2], key[3]

    def _done(self, after: Key | None, key: Sequence[Any]) -> int:
        """Return how many rows of a version lie before the place to begin at."""
        return after[4] + 1 if after and after[4] is not None and self._parse(after)[3] == key[3] else 0

    def _read_values(self, versions: list[Any], after: Key | None, until: Key | None) -> Iterator[Page]:
        ids = {version.calibration_id for version in versions}
        for found, first in _read_coefficients(self._database, ids):
            parts: list[tuple[Any, list[Any]]] = []
            for version in versions:
                key = [version.camera_id, version.valid_from, version.method, version.publication_id]
                if until is not None and tuple(key) > self._parse(until):
                    break
                begin = max(0, self._done(after, key) - first)
                is_last = until is not None and until[4] is not None and until[3] == version.publication_id
                end = max(0, until[4] + 1 - first) if until is not None and is_last else None
                rows = found.get(version.calibration_id, [])[begin:end]
                if rows:
                    parts.append((version, rows))
            if parts:
                yield _arrange(parts)


def _arrange(parts: list[tuple[Any, list[Any]]]) -> Page:
    """Arrange the coefficients of versions in columns."""
    heads = [
        (
            *(version.camera_id, version.make, version.model_name, version.serial, version.method),
            *(str(version.version), version.calibration_id),
            *(write_instant(version.valid_from), write_instant(version.valid_to) if version.valid_to else ""),
            *(version.campaign_id, write_instant(version.computed_at)),
        )
        for version, _ in parts
    ]
    counts = [len(rows) for _, rows in parts]
    same = [list(chain.from_iterable(map(repeat, texts, counts))) for texts in zip(*heads, strict=True)]
    _, _, name, value, u, unit, iso, f_number, band, channel, model, flags = zip(
        *chain.from_iterable(rows for _, rows in parts), strict=True
    )
    own = [
        *(name, [*map(repr, value)], [*map(repr, u)], unit),
        *(["" if each is None else repr(each) for each in column] for column in (iso, f_number)),
        *([each or "" for each in column] for column in (band, channel)),
        *(model, [*map(_join, flags)]),
    ]
    return [*same[:7], *own, *same[7:]]


def _group(versions: Sequence[Any]) -> Iterator[list[Any]]:
    """Group versions so that the rows of a group are a page, or those of one long version."""
    group: list[Any] = []
    count = 0
    for version in versions:
        if group and count + version.coefficients > _PAGE:
            yield group
            group, count = [], 0
        group.append(version)
        count += version.coefficients
    if group:
        yield group


def _read_coefficients(
    database: Database, calibration_ids: set[str]
) -> Iterator[tuple[dict[str, list[Any]], int]]:
    """Read the coefficients of versions, of a long one in parts; with each part the place where it begins."""
    row = CoefficientRow.__table__.c
    columns: tuple[Any, ...] = (
        *(row.calibration_id, row.position, row.name, row.value, row.standard_uncertainty, row.unit),
        *(row.iso, row.f_number, row.band, row.channel, row.model, cast(row.flags, Text)),
    )
    wanted = select(*columns).where(row.calibration_id.in_(calibration_ids))
    wanted = wanted.order_by(row.calibration_id, row.position)
    if len(calibration_ids) == 1:
        wanted = wanted.limit(_PAGE)
    first, last = 0, -math.inf
    while True:
        with database.reading() as session:
            found = session.connection().execute(wanted.where(row.position > last) if first else wanted).all()
        yield {owner: list(rows) for owner, rows in groupby(found, itemgetter(0))}, first
        if len(calibration_ids) > 1 or len(found) < _PAGE:
            return
        first, last = first + len(found), found[-1][1]


@cache
def _join(flags: str) -> str:
    return " ".join(json.loads(flags))


class MeasurementSeries:
    """Every measurement, by the time at which its frame was taken."""

    _KEY: ClassVar[tuple[Any, ...]] = (
        MeasuredRow.__table__.c.taken_from,
        MeasuredRow.__table__.c.measurement_id,
    )

    def __init__(self, database: Database, asked: Asked) -> None:
        self._database = database
        self._asked = asked

    def is_place(self, key: Key) -> bool:
        return len(key) == 2 and all(map(_is_plain, key)) and _is_instant(key[0])

    def read_state(self, session: Session) -> str:
        # rows are never deleted: their number says which they are
        mine = MeasuredRow.organisation_id == self._asked.organisation_id
        count = session.scalar(select(func.count()).select_from(MeasuredRow).where(mine))
        return f"{count} {_read_decisions(session, self._asked.organisation_id)}"

    def find_end(self, session: Session, *, after: Key | None, limit: int) -> Key | None:
        last = self._select(after, None).with_only_columns(*self._KEY).offset(limit - 1).limit(2)
        found = session.execute(last).all()
        return [write_instant(found[0][0]), found[0][1]] if len(found) > 1 else None

    def read(self, *, after: Key | None, until: Key | None) -> Iterator[Page]:
        states: dict[str, str] = {}
        while True:
            with self._database.reading() as session:
                # rows of the table: an entity's columns would go through the ORM's loading, row by row
                found = session.connection().execute(self._select(after, until).limit(_PAGE)).all()
                ids = {each for row in found for each in row[1:3] if each} - states.keys()
                states |= _read_states(session, ids)
                last = session.get_one(MeasuredRow, found[-1][0]) if len(found) == _PAGE else None
            if found:
                _, of, correctors, cells = zip(*found, strict=True)
                page: Page = list(zip(*csv.reader(cells), strict=True))
                page[STATE] = [states[each] for each in of]
                raised = {pair: _raise_flags(states, *pair) for pair in set(zip(of, correctors, strict=True))}
                if any(raised.values()):
                    pairs = zip(page[FLAGS], zip(of, correctors, strict=True), strict=True)
                    page[FLAGS] = [
                        " ".join(dict.fromkeys([*flags.split(), *raised[pair]])) for flags, pair in pairs
                    ]
                yield page
            if last is None:
                return
            after = [write_instant(last.taken_from), last.measurement_id]

    def _select(self, after: Key | None, until: Key | None) -> Select[Any]:
        asked, row = self._asked, MeasuredRow.__table__.c
        where = [
            row.organisation_id == asked.organisation_id,
            *_equal(row, asked, "camera_id", "campaign_id", "calibration_id"),
            *_between(row.created_at, asked.computed_start, asked.computed_end),
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
                place = _place((_read_instant(key[0]), key[1]), self._KEY)
                where.append(tuple_(*self._KEY) > place if is_after else tuple_(*self._KEY) <= place)
        columns: tuple[Any, ...] = (row.measurement_id, row.calibration_id, row.corrector_id, row.cells)
        return select(*columns).where(*where).order_by(*self._KEY)


def _raise_flags(states: dict[str, str], calibration_id: str, corrector_id: str | None) -> list[str]:
    """Return the flags of what has become of a version, and of the one that corrected its frames."""
    flags = [STATE_FLAGS[states[calibration_id]].code] if states[calibration_id] in STATE_FLAGS else []
    revoked = corrector_id is not None and states[corrector_id] == "revoked"
    return [*flags, *([shared.CALIBRATION_REVOKED.code] if revoked else [])]


def _equal(row: Any, asked: Asked, *names: str) -> Iterator[ColumnElement[bool]]:  # noqa: ANN401
    for name in names:
        if getattr(asked, name) is not None:
            yield getattr(row, name) == getattr(asked, name)


def _between(column: Any, start: datetime | None, end: datetime | None) -> list[ColumnElement[bool]]:  # noqa: ANN401
    return [*([column >= start] if start else []), *([column < end] if end else [])]


def _place(values: Sequence[Any], key: Sequence[Any]) -> Any:  # noqa: ANN401
    return tuple_(*(literal(value, each.type) for value, each in zip(values, key, strict=True)))


def _is_plain(part: object) -> bool:
    # PostgreSQL cannot even be asked for a NUL
    return isinstance(part, str) and part.isascii() and part.isprintable()


def _is_instant(text: str) -> bool:
    try:
        return 1 < datetime.fromisoformat(text).astimezone(UTC).year < 9999
    except (ValueError, OverflowError):
        return False


def _read_instant(text: str) -> datetime:
    return datetime.fromisoformat(text).astimezone(UTC)


def _read_decisions(session: Session, organisation_id: str) -> str:
    """Return what changes with every decision about a version: rows are only added and closed."""
    row = ReadyRow
    counts = session.execute(
        select(func.count(), func.count(row.known_to)).where(row.organisation_id == organisation_id)
    ).one()
    revoked = session.scalar(
        select(func.count())
        .select_from(Revocation)
        .join(Calibration, Calibration.id == Revocation.calibration_id)
        .where(Calibration.organisation_id == organisation_id)
    )
    return f"{counts[0]} {counts[1]} {revoked}"


def _read_states(session: Session, calibration_ids: set[str]) -> dict[str, str]:
    """Return the state of each version, without the rest of its status."""
    published = select(Publication.id).where(Publication.calibration_id == Calibration.id)
    stands = and_(Publication.known_to.is_(None), Publication.superseded_by.is_(None))
    state = case(
        (
            select(Revocation.calibration_id).where(Revocation.calibration_id == Calibration.id).exists(),
            "revoked",
        ),
        (~published.exists(), "draft"),
        (published.where(stands).exists(), "published"),
        else_="superseded",
    )
    rows = session.execute(select(Calibration.id, state).where(Calibration.id.in_(calibration_ids)))
    return {row[0]: row[1] for row in rows}
