"""A PostgreSQL that does not answer, or not in time: nobody waits for ever."""

import asyncio
import threading
import time
from pathlib import Path

import pytest
from sqlalchemy import Integer, bindparam, column, select, table, text
from sqlalchemy.exc import DataError, InterfaceError, OperationalError, ProgrammingError

from store.database import Database
from store.migrate import migrate
from tests.support.proxy import Proxy

LIMIT_S = 0.6
_END_ALL = (
    "SELECT pg_terminate_backend(pid) FROM pg_stat_activity "
    "WHERE pid <> pg_backend_pid() AND datname = current_database()"
)


@pytest.fixture
def url(postgres, migrated_postgres):
    url = postgres.new_database(like=migrated_postgres)
    yield url
    postgres.drop_database(url)


@pytest.fixture
def proxy(url):
    with Proxy(Path(url.partition("?host=")[2]) / ".s.PGSQL.5432") as proxy:
        yield proxy


def through(proxy, url):
    name = url.partition("?")[0].rpartition("/")[2]
    return f"postgresql+psycopg://stilb@{proxy.address}/{name}"


@pytest.fixture
def database(url, proxy):
    opened = Database(through(proxy, url), answer_within_s=LIMIT_S)
    yield opened
    opened.dispose()


def ask(database, statement="SELECT 1"):
    with database.reading() as session:
        return session.scalar(text(statement))


def test_a_server_that_falls_silent_is_given_up_and_connected_to_anew(database, proxy):
    """As it is asked, when it is connected to, and within a transaction."""
    assert ask(database) == 1
    with proxy.being("silent"):
        began = time.monotonic()
        with pytest.raises(OperationalError):
            ask(database)
        with pytest.raises(OperationalError, match="timeout"):
            ask(database)
        assert time.monotonic() - began < 120
    assert ask(database) == 1
    with database.reading() as session:
        session.execute(text("SELECT 1"))
        with proxy.being("silent"), pytest.raises(OperationalError, match="no answer within"):
            session.execute(text("SELECT 1"))
    assert ask(database) == 1


def test_what_an_event_loop_asks_ends_with_what_fails(database, proxy):
    number = select(60 // bindparam("number", type_=Integer))

    async def ask_all():
        asked = (database.ask(number, {"number": each}) for each in range(1, 31))
        assert [rows[0][0] for rows in await asyncio.gather(*asked)] == [60 // each for each in range(1, 31)]
        with pytest.raises(DataError, match="division by zero"):
            await database.ask(number, {"number": 0})
        with database.reading() as session:
            session.execute(text(_END_ALL))
        assert await database.ask(number, {"number": 6}) == [(10,)]
        with proxy.being("silent"), pytest.raises(InterfaceError, match="no answer within"):
            await database.ask(number, {"number": 6})
        assert await database.ask(number, {"number": 6}) == [(10,)]
        with pytest.raises(ProgrammingError, match="nothing_there"):
            await database.ask(select(table("nothing_there", column("x"))), {})

    asyncio.run(ask_all())


def test_a_statement_that_takes_too_long_is_ended_by_the_server(database):
    with pytest.raises(OperationalError, match="statement timeout"):
        ask(database, "SELECT pg_sleep(20)")
    assert ask(database) == 1


def test_an_answer_that_comes_slowly_is_no_silence(url, proxy):
    """Rows that keep coming for longer than the limit of silence are read to the end."""
    address = f"{through(proxy, url)}?options=-c%20statement_timeout=0"
    database = Database(address, answer_within_s=0.1)
    ask(database)
    proxy.become("slow")
    with database.reading() as session:
        began = time.monotonic()
        rows = session.execute(text("SELECT repeat('x', 100000) FROM generate_series(1, 12)")).all()
        assert (len(rows), time.monotonic() - began > 2.2) == (12, True)
    database.dispose()


def test_a_lock_is_not_waited_for_for_long(database, url):
    locked = threading.Event()
    done = threading.Event()
    other = Database(url)

    def hold():
        with other.writing("test") as session:
            session.execute(text("LOCK TABLE organisation"))
            locked.set()
            done.wait(30)

    holder = threading.Thread(target=hold)
    holder.start()
    locked.wait(30)
    try:
        with pytest.raises(OperationalError, match="lock timeout"):
            ask(database, "SELECT count(*) FROM organisation")
    finally:
        done.set()
        holder.join()
        other.dispose()


def test_a_migration_has_no_such_limits(url):
    patient = Database(url, answer_within_s=None)
    migrate(patient)
    assert [ask(patient, f"SHOW {name}") for name in ("statement_timeout", "lock_timeout")] == ["0", "0"]
    patient.dispose()


def test_who_is_stopped_amid_a_transaction_loses_its_locks_before_others_give_up(url):
    stopped, other = (Database(url, answer_within_s=12.0) for _ in range(2))
    lock = text("LOCK TABLE organisation")

    def store():
        with stopped.writing("worker") as held:
            held.execute(lock)
            with other.writing("service") as session:
                session.execute(lock)

    try:
        with pytest.raises(OperationalError, match="idle-in-transaction timeout"):
            store()
        assert ask(stopped) == 1
    finally:
        stopped.dispose()
        other.dispose()
