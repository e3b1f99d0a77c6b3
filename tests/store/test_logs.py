"""What is expected to happen is a line in the log, what is not is a traceback."""

import json
import logging
from datetime import datetime, timedelta

import pytest
from redis.exceptions import ConnectionError as BrokerLost
from sqlalchemy import text
from sqlalchemy.exc import OperationalError

from store.log_fields import fields
from store.logs import JsonLines, TextLines, add_fields, shorten


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


def test_a_line_has_the_fields_of_its_request_as_text_and_as_json():
    record = logging.LogRecord("stilb.request", logging.INFO, "f", 1, "request", (), None)
    record.fields = {"status": 201}
    with fields(request_id="req_1", jobs=["job_1", "job_2"]):
        add_fields(record)
    text, told = TextLines().format(record), json.loads(JsonLines().format(record))
    assert text.endswith(" INFO stilb.request: request request_id=req_1 jobs=job_1,job_2 status=201")
    assert datetime.fromisoformat(told.pop("time")).utcoffset() == timedelta(0)
    assert told == {
        "level": "INFO",
        "logger": "stilb.request",
        "message": "request",
        "request_id": "req_1",
        "jobs": ["job_1", "job_2"],
        "status": 201,
    }


def test_a_traceback_is_part_of_its_json_line():
    error = ValueError("x")
    record = logging.LogRecord("x", logging.ERROR, "f", 1, "lost", (), (ValueError, error, None))
    line = JsonLines().format(record)
    assert "\n" not in line
    assert json.loads(line)["traceback"] == "ValueError: x"
