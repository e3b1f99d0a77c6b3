"""The series of coefficients: of every version in force, from its ready row and its coefficients."""

import json
import math
from collections.abc import Iterator, Sequence
from datetime import datetime
from functools import cache
from itertools import chain, groupby, repeat
from operator import itemgetter
from typing import Any, ClassVar

from sqlalchemy import Select, Text, cast, func, select, tuple_
from sqlalchemy.orm import Session

from store.columns import utc_now
from store.database import Database, read_plainly
from store.ready import series
from store.ready.publications import write_instant
from store.ready.series import PAGE, Asked, Key, Page
from store.tables import Camera, CoefficientRow, ReadyRow

_MOST_PLACES = 1 << 31
_VERSIONS = 1000
_ARRANGED = 25
"""Versions that are written at once: their cells stay in the processor's cache."""


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
        versions, rows = session.execute(select(func.count(), func.sum(counts.c.coefficients))).one()
        if max(versions, rows or 0) <= limit:
            return None
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
                found = list(session.execute(self._select(known, after, until).limit(_VERSIONS)))
            for some in _group(found):
                yield from self._read_values(some, after, until)
            if len(found) < _VERSIONS:
                return
            last = found[-1]
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
        columns: tuple[Any, ...] = (
            *(row.publication_id, row.camera_id, Camera.make, Camera.model.label("model_name")),
            *(Camera.serial, row.method, row.version, row.calibration_id, row.campaign_id),
            *(row.valid_from, row.valid_to, row.computed_at, row.coefficients),
        )
        return select(*columns).join(Camera, Camera.id == row.camera_id).where(*where).order_by(*order)

    def _parse(self, key: Key) -> tuple[Any, ...]:
        return key[0], series.read_instant(key[1]), key[2], key[3]

    def _done(self, after: Key | None, key: Sequence[Any]) -> int:
        """Return how many rows of a version lie before the place to begin at."""
        return after[4] + 1 if after and after[4] is not None and self._parse(after)[3] == key[3] else 0

    def _read_values(self, versions: list[Any], after: Key | None, until: Key | None) -> Iterator[Page]:
        for found, first in _read_coefficients(self._database, {each.calibration_id for each in versions}):
            parts = [(version, found.get(version.calibration_id, [])) for version in versions]
            # a series ends within its last version, and begins within its first one
            for which, key in ((-1, until), (0, after)):
                version, rows = parts[which]
                if key is not None and key[3] == version.publication_id and key[4] is not None:
                    count = max(0, key[4] + 1 - first)
                    parts[which] = (version, rows[count:] if key is after else rows[:count])
            parts = [part for part in parts if part[1]]
            for place in range(0, len(parts), _ARRANGED):
                yield _arrange(parts[place : place + _ARRANGED])


def _arrange(parts: list[tuple[Any, list[Any]]]) -> Page:
    """Arrange the coefficients of versions in columns."""
    heads = []
    for (_, *head, valid_from, valid_to, computed_at, _), _ in parts:
        ended = write_instant(valid_to) if valid_to else ""
        heads.append((*head, write_instant(valid_from), ended, write_instant(computed_at)))
    counts = [len(rows) for _, rows in parts]
    same = [list(chain.from_iterable(map(repeat, texts, counts))) for texts in zip(*heads, strict=True)]
    *of, campaign_id, valid_from, valid_to, computed_at = same
    _, _, name, value, u, unit, iso, f_number, band, channel, model, flags = zip(
        *chain.from_iterable(rows for _, rows in parts), strict=True
    )
    words = [[each or "" for each in column] for column in (band, channel)]
    told = [*of, name, value, u, unit, iso, f_number, *words, model, [*map(_join, flags)]]
    return [*told, valid_from, valid_to, campaign_id, computed_at]


def _group(versions: Sequence[Any]) -> Iterator[list[Any]]:
    """Group versions so that the rows of a group are a page, or those of one long version."""
    group: list[Any] = []
    count = 0
    for version in versions:
        if group and count + version.coefficients > PAGE:
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
        wanted = wanted.limit(PAGE)
    first, last = 0, -math.inf
    while True:
        with database.reading() as session:
            found = read_plainly(session, wanted.where(row.position > last) if first else wanted)
        yield {owner: list(rows) for owner, rows in groupby(found, itemgetter(0))}, first
        if len(calibration_ids) > 1 or len(found) < PAGE:
            return
        first, last = first + len(found), found[-1][1]


@cache
def _join(flags: str) -> str:
    return " ".join(json.loads(flags))
