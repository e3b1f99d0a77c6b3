"""Chores: what a process repeats in a thread of its own, beside the work that it is there for."""

import logging
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Final

from sqlalchemy.exc import SQLAlchemyError

from store.blobs import Blobs, StorageUnavailable
from store.database import summarise
from store.partials import Partials
from store.schema import SchemaDiffers

log = logging.getLogger(__name__)

_AFTER_FAULT_S: Final = 10.0
_FLOOR_EVERY_S: Final = 3600.0
_ABANDONED_AFTER_S: Final = 24 * 3600.0


def repeat(name: str, chore: Callable[[], float]) -> None:
    """Do a chore until the process ends, each time after the pause [s] that the last one returned."""
    threading.Thread(target=_repeat, args=[name, chore], name=name, daemon=True).start()


def _repeat(name: str, chore: Callable[[], float]) -> None:
    trouble = ""
    while True:
        try:
            pause_s = chore()
            if trouble:
                log.warning("%s: works again", name)
            trouble = ""
        except SchemaDiffers:
            return
        except (SQLAlchemyError, StorageUnavailable, OSError) as error:
            pause_s = _AFTER_FAULT_S
            if not trouble:
                trouble = summarise(error)
                log.warning("%s: fails until further notice: %s", name, trouble)
        time.sleep(pause_s)


def sweep_floor(blobs: Blobs, partials: Partials) -> None:
    """Remove every hour what killed uploads left a day ago, and uploads in pieces that have expired."""
    repeat("floor", partial(_sweep_floor, blobs, partials))


def _sweep_floor(blobs: Blobs, partials: Partials) -> float:
    removed = blobs.sweep_temporary(_ABANDONED_AFTER_S) + partials.sweep()
    if removed:
        log.info("removed %d abandoned uploads", removed)
    return _FLOOR_EVERY_S
