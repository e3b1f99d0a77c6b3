"""How every process of stilb logs: one line for what is expected to happen, a traceback for what is not."""

import logging

from kombu.exceptions import OperationalError as BrokerAway
from redis.exceptions import ConnectionError as BrokerLost
from redis.exceptions import TimeoutError as BrokerSilent
from sqlalchemy.exc import InterfaceError, OperationalError
from sqlalchemy.exc import TimeoutError as NoConnectionFree

from store.database import summarise
from store.schema import is_about_missing_parts

_EXPECTED = (
    *(BrokerAway, BrokerLost, BrokerSilent),
    *(OperationalError, InterfaceError, NoConnectionFree),
    *(ConnectionError, TimeoutError),
)


def configure_logging() -> None:
    """Log to stderr, from the level of information on."""
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    for handler in logging.getLogger().handlers:
        handler.addFilter(shorten)


def shorten(record: logging.LogRecord) -> bool:
    """Put the words of an error that will pass in the place of its traceback, which says nothing."""
    error = record.exc_info[1] if record.exc_info else None
    if isinstance(error, _EXPECTED) and not _is_ours(error):
        record.msg = f"{record.getMessage().strip()}: {summarise(error)}"
        record.args = ()
        record.exc_info = record.exc_text = None
    return True


def _is_ours(error: BaseException) -> bool:
    return isinstance(error, OperationalError) and is_about_missing_parts(error)
