"""What is expected to happen is a line in the log, what is not is a traceback."""

import logging

import pytest
from redis.exceptions import ConnectionError as BrokerLost
from sqlalchemy import text
from sqlalchemy.exc import OperationalError

from store.logs import shorten


def logged(error):
    record = logging.LogRecord("x", logging.WARNING, "f", 1, "lost %s", ("it",), (type(error), error, None))
    assert shorten(record)
    return logging.Formatter().format(record)


@pytest.mark.parametrize(
    "error",
    [
        BrokerLost("Connection refused"),
        ConnectionResetError("Connection refused"),
        OperationalError("SELECT 1", {}, Exception("Connection refused\nIs the server running?")),
    ],
)
def test_what_will_pass_is_one_line(error):
    words = logged(error)
    assert words.startswith("lost it: Connection refused")
    assert "\n" not in words


def test_what_will_not_pass_keeps_its_traceback(database):
    with pytest.raises(Exception, match="nowhere") as raised, database.reading() as session:
        session.execute(text("SELECT 1 FROM nowhere"))
    assert "sqlalchemy" in logged(raised.value)
    assert "ValueError: x" in logged(ValueError("x"))
