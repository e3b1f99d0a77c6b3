"""The series of measurements: stored rows, with what has become of their versions."""

import csv
from collections.abc import Iterator
from typing import Any, ClassVar

from sqlalchemy import Select, and_, case, select, tuple_
from sqlalchemy.orm import Session

from radiometry.findings import shared
from store.database import Database, read_plainly
from store.ready import series
from store.ready.measurements import BODY, COLUMNS, FLAGS, STATE
from store.ready.publications import write_instant
from store.ready.records import is_plain, write_record
from store.ready.series import PAGE, Asked, Key, Page
from store.tables import Calibration, Camera, MeasuredRow, Measurement, Publication, Revocation

State = tuple[int, str]
"""Number of a version, and what has become of it."""
_AFTER_FLAGS = len(COLUMNS) - FLAGS - 1
_BODY_AFTER = slice(BODY.start - FLAGS, BODY.stop - FLAGS)
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
        states: dict[str, State] = {}
        names: dict[str, str] = {}
        while True:
            with self._database.reading() as session:
                found = read_plainly(session, self._select(after, until).limit(PAGE))
                ids = {each for row in found for each in (row[1], row[2]) if each} - states.keys()
                states |= _read_states(session, ids)
                names |= _read_names(session, {row[3] for row in found} - names.keys())
                last = session.get_one(MeasuredRow, found[-1][0]) if len(found) == PAGE else None
            yield from series.cut(_settle(found, states, names))
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


def _settle(rows: list[Any], states: dict[str, State], names: dict[str, str]) -> list[str]:
    """Return the records with what has become of their versions, and the names that the cameras have now."""
    records = []
    known: dict[tuple[str, str | None], tuple[str, str, list[str]]] = {}
    for _, of, corrector, camera, record in rows:
        if (of, corrector) not in known:
            version, state = states[of]
            stored = f",{of},{version},"
            known[of, corrector] = (f"{stored},", f"{stored}{state},", _raise_flags(states, of, corrector))
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


def _raise_flags(states: dict[str, State], calibration_id: str, corrector_id: str | None) -> list[str]:
    """Return the flags of what has become of a version, and of the one that corrected its frames."""
    _, state = states[calibration_id]
    flags = [STATE_FLAGS[state].code] if state in STATE_FLAGS else []
    revoked = corrector_id is not None and states[corrector_id][1] == "revoked"
    return [*flags, *([shared.CALIBRATION_REVOKED.code] if revoked else [])]


def _read_names(session: Session, camera_ids: set[str]) -> dict[str, str]:
    """Return make, model and serial number of each camera, as a record has them."""
    if not camera_ids:
        return {}
    columns = Camera.id, Camera.make, Camera.model, Camera.serial
    rows = session.execute(select(*columns).where(Camera.id.in_(camera_ids)))
    return {row[0]: write_record(row[1:]) for row in rows}


def _read_states(session: Session, calibration_ids: set[str]) -> dict[str, State]:
    """Return number and state of each version, without the rest of its status."""
    if not calibration_ids:
        return {}
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
    wanted = select(Calibration.id, Calibration.version, state)
    rows = session.execute(wanted.where(Calibration.id.in_(calibration_ids)))
    return {row[0]: (row[1], row[2]) for row in rows}
