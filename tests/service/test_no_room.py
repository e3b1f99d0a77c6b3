"""A database without room says so: what is sent is refused as such, and what is there can be read."""

import pytest
from psycopg.errors import DiskFull
from sqlalchemy import event
from sqlalchemy.exc import OperationalError

from store.database import is_full
from tests.support.house import CAMERA


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
def test_a_database_without_room_is_no_database_that_does_not_answer(house):
    known = house.camera()

    def take_all_room(connection, _record):
        connection.execute("PRAGMA max_page_count = 1")

    house.database.dispose()
    event.listen(house.database.engine, "connect", take_all_room)
    note = "x" * 900
    answers = [
        house.http.post("/v1/cameras", json={**CAMERA, "serial": str(i), "note": note}) for i in range(50)
    ]
    refused = [answer for answer in answers if answer.status_code != 201]
    assert {(answer.status_code, answer.json()["code"]) for answer in refused} == {(507, "storage_full")}
    assert refused[0].json()["retryable"] is True
    assert refused[0].headers["Retry-After"]
    assert house.get(f"/v1/cameras/{known['id']}") == known


def test_postgresql_says_it_its_own_way():
    assert is_full(OperationalError("INSERT", {}, DiskFull("could not extend file")))
    assert not is_full(OperationalError("INSERT", {}, Exception("server closed the connection")))
