"""The series of measurements: stored rows, with what has become of their versions."""

import csv
from collections.abc import Iterator, Sequence
from typing import Any, ClassVar

from sqlalchemy import Select, and_, case, select, tuple_
from sqlalchemy.orm import Session

from radiometry.findings import shared
from store.database import Database, read_plainly
from store.ready import series
from store.ready.measurements import BODY, COLUMNS, FLAGS, STATE
from store.ready.publications import write_instant
from store.ready.series import PAGE, Asked, Key, Page
from store.tables import Calibration, Camera, MeasuredRow, Measurement, Publication, Revocation

_ROWS = 250
"""Rows that are split at once: their cells stay in the processor's cache."""
STATE_FLAGS = {
    "draft": shared.CALIBRATION_NOT_PUBLISHED,
    "superseded": shared.CALIBRATION_SUPERSEDED,
    "revoked": shared.CALIBRATION_REVOKED,
}
"""Flag of what was measured with a version in this state."""


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
        return len(key) == 2 and all(map(series.is_plain, key)) and series.is_instant(key[0])

    def read_state(self, session: Session) -> str:
        return series.read_state(session, self._asked.organisation_id, "measurement")

    def find_end(self, session: Session, *, after: Key | None, limit: int) -> Key | None:
        last = self._select(after, None).with_only_columns(*self._KEY).offset(limit - 1).limit(2)
        found = session.execute(last).all()
        return [write_instant(found[0][0]), found[0][1]] if len(found) > 1 else None

    def read(self, *, after: Key | None, until: Key | None) -> Iterator[Page]:
        states: dict[str, str] = {}
        names: dict[str, tuple[str, ...]] = {}
        while True:
            with self._database.reading() as session:
                found = read_plainly(session, self._select(after, until).limit(PAGE))
                ids = {each for row in found for each in row[1:3] if each} - states.keys()
                states |= _read_states(session, ids)
                names |= _read_names(session, {row[3] for row in found} - names.keys())
                last = session.get_one(MeasuredRow, found[-1][0]) if len(found) == PAGE else None
            for first in range(0, len(found), _ROWS):
                yield _arrange(found[first : first + _ROWS], states, names)
            if last is None:
                return
            after = [write_instant(last.taken_from), last.measurement_id]

    def _select(self, after: Key | None, until: Key | None) -> Select[Any]:
        asked, row = self._asked, MeasuredRow.__table__.c
        where = [
            row.organisation_id == asked.organisation_id,
            *series.match_equal(row, asked, "camera_id", "campaign_id", "calibration_id"),
            *series.match_between(row.created_at, asked.computed_start, asked.computed_end),
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
                place = series.bind_place((series.read_instant(key[0]), key[1]), self._KEY)
                where.append(tuple_(*self._KEY) > place if is_after else tuple_(*self._KEY) <= place)
        columns: tuple[Any, ...] = (
            *(row.measurement_id, row.calibration_id, row.corrector_id, row.camera_id),
            row.cells,
        )
        return select(*columns).where(*where).order_by(*self._KEY)


def _arrange(rows: list[Any], states: dict[str, str], names: dict[str, tuple[str, ...]]) -> Page:
    """Return columns with what has become of the versions, and the names that the cameras have now."""
    _, of, correctors, cameras, cells = zip(*rows, strict=True)
    page = _split(cells)
    page[BODY] = zip(*(names[each] for each in cameras), strict=True)
    page[STATE] = [states[each] for each in of]
    raised = {pair: _raise_flags(states, *pair) for pair in set(zip(of, correctors, strict=True))}
    if any(raised.values()):
        pairs = zip(page[FLAGS], zip(of, correctors, strict=True), strict=True)
        page[FLAGS] = [" ".join(dict.fromkeys([*flags.split(), *raised[pair]])) for flags, pair in pairs]
    return page


def _split(records: Sequence[str]) -> Page:
    """Split CSV records into columns."""
    joined = ",".join(records)
    if '"' in joined:
        return list(zip(*csv.reader(records), strict=True))
    # one list of all cells: a list for each record would be collected as garbage time and again
    cells, width = joined.split(","), len(COLUMNS)
    return [cells[place::width] for place in range(width)]


def _raise_flags(states: dict[str, str], calibration_id: str, corrector_id: str | None) -> list[str]:
    """Return the flags of what has become of a version, and of the one that corrected its frames."""
    flags = [STATE_FLAGS[states[calibration_id]].code] if states[calibration_id] in STATE_FLAGS else []
    revoked = corrector_id is not None and states[corrector_id] == "revoked"
    return [*flags, *([shared.CALIBRATION_REVOKED.code] if revoked else [])]


def _read_names(session: Session, camera_ids: set[str]) -> dict[str, tuple[str, ...]]:
    """Return make, model and serial number of each camera."""
    columns = Camera.id, Camera.make, Camera.model, Camera.serial
    return {row[0]: row[1:] for row in session.execute(select(*columns).where(Camera.id.in_(camera_ids)))}


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
