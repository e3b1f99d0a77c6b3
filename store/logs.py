"""How every process of stilb logs: one line for what is expected to happen, a traceback for what is not."""

import json
import logging
from datetime import UTC, datetime
from typing import Any

from sqlalchemy.exc import InterfaceError, OperationalError
from sqlalchemy.exc import TimeoutError as NoConnectionFree

from store import database, log_fields

_EXPECTED = (OperationalError, InterfaceError, NoConnectionFree, ConnectionError, TimeoutError)
# by name: few processes load what talks to the broker
_BROKER_AWAY = {
    "kombu.exceptions.OperationalError",
    "redis.exceptions.ConnectionError",
    "redis.exceptions.TimeoutError",
}


def configure_logging(form: str) -> None:
    """Log to stderr, from the level of information on: lines of text, or of JSON."""
    logging.basicConfig(level=logging.INFO)
    for handler in logging.getLogger().handlers:
        handler.addFilter(shorten)
        handler.addFilter(add_fields)
        handler.setFormatter(JsonLines() if form == "json" else TextLines())


def add_fields(record: logging.LogRecord) -> bool:
    record.fields = {**log_fields.present_fields(), **getattr(record, "fields", {})}
    return True


class TextLines(logging.Formatter):
    """`time level logger: message name=value ...`."""

    def __init__(self) -> None:
        super().__init__("%(asctime)s %(levelname)s %(name)s: %(message)s")

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802  logging calls it
        known: dict[str, Any] = getattr(record, "fields", {})
        texts = {name: ",".join(each) if isinstance(each, list) else each for name, each in known.items()}
        return super().formatMessage(record) + "".join(f" {name}={text}" for name, text in texts.items())


class JsonLines(logging.Formatter):
    def format(self, record: logging.LogRecord) -> str:
        line = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname,
            "logger": record.name,
            "message": record.getMessage(),
            **getattr(record, "fields", {}),
        }
        if record.exc_info:
            line["traceback"] = self.formatException(record.exc_info)
        return json.dumps(line, default=str)


def shorten(record: logging.LogRecord) -> bool:
    """Put the words of an error that will pass in the place of its traceback, which says nothing."""
    error = record.exc_info[1] if record.exc_info else None
    if isinstance(error, Exception) and _is_expected(error):
        record.msg = f"{record.getMessage().strip()}: {database.summarise(error)}"
        record.args = ()
        record.exc_info = record.exc_text = None
    return True


def _is_expected(error: Exception) -> bool:
    if isinstance(error, OperationalError) and database.is_about_missing_parts(error):
        return False
    names = {f"{each.__module__}.{each.__qualname__}" for each in type(error).__mro__}
    return isinstance(error, _EXPECTED) or not names.isdisjoint(_BROKER_AWAY)
