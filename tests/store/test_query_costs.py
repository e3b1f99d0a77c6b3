"""Queries of what grows: one camera's series reads its index, a fit reads its frames in columns."""

import re
from contextlib import contextmanager
from datetime import UTC, datetime

import pytest
from sqlalchemy import event

from bench.frames import copy_frame
from store.queries.evidence import gather
from store.ready.series import Asked, CoefficientSeries, MeasurementSeries
from store.tables import Campaign
from tests.support.campaigns import ROI

WHOLE = re.compile(r"SCAN (audit|calib|camera|meas|publ|ready|revo)|\(organisation_id=\?\)|Seq Scan")
"""A plan that reads a whole table, or all rows of an organisation."""
INSTANT = "2026-05-01T00:00:00Z"
PLACES = {
    CoefficientSeries: ["cam_1", INSTANT, "luminance", "pub_1", 0],
    MeasurementSeries: [INSTANT, "msr_1"],
}
INDEXES = {
    CoefficientSeries: ("ready", "ix_ready_series"),
    MeasurementSeries: ("measured", "ix_measured_camera_id"),
}


@contextmanager
def statements(database):
    found = []

    def note(_connection, _cursor, statement, parameters, _context, _many):
        found.append((statement, parameters))

    # PostgreSQL's writer is its reader with another option
    engines = [database._reader, database.engine] if database.is_sqlite else [database._reader]
    for engine in engines:
        event.listen(engine, "before_cursor_execute", note)
    try:
        yield found
    finally:
        for engine in engines:
            event.remove(engine, "before_cursor_execute", note)


@pytest.mark.parametrize("series", [CoefficientSeries, MeasurementSeries])
def test_series_of_one_camera_reads_its_index_in_order(database, series):
    asked = Asked(organisation_id="org_1", camera_id="cam_1", start=datetime(2026, 1, 1, tzinfo=UTC))
    table, index = INDEXES[series]
    with statements(database) as executed, database.reading() as session:
        for after in (None, PLACES[series]):
            series(database, asked).read_state(session)
            series(database, asked).find_end(session, after=after, limit=10)
            list(series(database, asked).read(after=after, until=None))
    for statement, parameters in executed:
        if statement.startswith("SELECT"):
            plan = explain(database, statement, parameters)
            assert not WHOLE.search(plan), plan
    pages = [each for each in executed if f"FROM {table}" in each[0] and "ORDER BY" in each[0]]
    assert len(pages) >= 4 - 2 * (series is CoefficientSeries)
    for statement, parameters in pages:
        plan = explain(database, statement, parameters)
        assert index in plan, plan
        assert "camera_id" in plan.partition(index)[2].partition("\n")[0 if database.is_sqlite else 2], plan
        assert "TEMP B-TREE" not in plan, plan
        assert "Sort" not in plan, plan


def explain(database, statement, parameters):
    with database.engine.connect() as connection:
        if database.is_sqlite:
            rows = connection.exec_driver_sql(f"EXPLAIN QUERY PLAN {statement}", parameters)
            return "\n".join(row[3] for row in rows)
        # an empty table is read whole, whatever indexes it has
        for way in ("seqscan", "bitmapscan", "sort"):
            connection.exec_driver_sql(f"SET LOCAL enable_{way} = off")
        return "\n".join(row[0] for row in connection.exec_driver_sql(f"EXPLAIN {statement}", parameters))


@pytest.mark.either_database
def test_input_of_a_fit_is_read_once_and_in_columns(house):
    campaign = house.campaign()
    house.http.put(f"/v1/campaigns/{campaign['id']}/roi", json=ROI)
    contents = [house.frame_bytes(seed=seed) for seed in (1, 2)]
    frames = [house.upload(campaign, each, role="light", scene="level-1")["id"] for each in contents]
    house.work()
    executed, entities = {}, {}
    for frame_id, more, count in zip(frames, (98, 900), (100, 1000), strict=True):
        copy_frame(house.worker, frame_id, more + 1)
        loaded = []
        with statements(house.database) as found, house.database.reading() as session:
            event.listen(session, "loaded_as_persistent", lambda _, row, loaded=loaded: loaded.append(row))
            gathered = gather(session, session.get_one(Campaign, campaign["id"]))
        assert len(gathered.frames) == count
        executed[count] = len(found)
        entities[count] = len(loaded)
    assert executed[100] == executed[1000] <= 12
    assert entities[100] == entities[1000] <= 4
