"""How every process of stilb logs: one line for what is expected to happen, a traceback for what is not."""

import logging

from sqlalchemy.exc import InterfaceError, OperationalError
from sqlalchemy.exc import TimeoutError as NoConnectionFree

from store.database import summarise
from store.schema import is_about_missing_parts

_EXPECTED = (OperationalError, InterfaceError, NoConnectionFree, ConnectionError, TimeoutError)
# by name: few processes load what talks to the broker
_BROKER_AWAY = {
    "kombu.exceptions.OperationalError",
    "redis.exceptions.ConnectionError",
    "redis.exceptions.TimeoutError",
}


def configure_logging() -> None:
    """Log to stderr, from the level of information on."""
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    for handler in logging.getLogger().handlers:
        handler.addFilter(shorten)


def shorten(record: logging.LogRecord) -> bool:
    """Put the words of an error that will pass in the place of its traceback, which says nothing."""
    error = record.exc_info[1] if record.exc_info else None
    if isinstance(error, Exception) and _is_expected(error):
        record.msg = f"{record.getMessage().strip()}: {summarise(error)}"
        record.args = ()
        record.exc_info = record.exc_text = None
    return True


def _is_expected(error: Exception) -> bool:
    if isinstance(error, OperationalError) and is_about_missing_parts(error):
        return False
    names = {f"{each.__module__}.{each.__qualname__}" for each in type(error).__mro__}
    return isinstance(error, _EXPECTED) or not names.isdisjoint(_BROKER_AWAY)
