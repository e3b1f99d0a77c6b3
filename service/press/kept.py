"""Rendered files: each is made in a process of its own, and kept under the hash of all that goes in."""

import hashlib
import logging
import subprocess
import sys
from pathlib import Path
from typing import Final

from sqlalchemy.exc import SQLAlchemyError

from service.context import Context
from store.blobs import BlobDamaged, StorageFull, StorageUnavailable
from store.files import keep_blob
from store.software import RENDERER
from store.tables import Rendering

log = logging.getLogger(__name__)

_ROOT: Final = Path(__file__).parents[2]
_WITHIN_S: Final = 300.0


def name_source(content: bytes) -> str:
    """Return the name that a file is kept under: the hash of what it shows and of how that is rendered."""
    return hashlib.sha256(RENDERER.encode() + b" " + content).hexdigest()


def find_rendered(context: Context, source: str) -> bytes | None:
    """Return the file that is kept; None if it was never made, or lost since.

    What is kept keeps its bytes, whatever Typst sets later.
    """
    with context.database.reading() as session:
        kept = session.get(Rendering, source)
    if kept is None:
        return None
    try:
        return b"".join(context.files.open(kept.sha256)[1])
    except (BlobDamaged, StorageUnavailable) as fault:
        log.warning("a file is rendered again: %s", fault)
        return None


def render_and_keep(context: Context, source: str, order: bytes) -> bytes:
    """Return a new file, which is kept where there is room."""
    rendered = render_apart(order)
    try:
        with context.blobs.writer() as writer:
            writer.write(rendered)
            blob = writer.commit()
        with context.database.writing("rendering") as session:
            keep_blob(session, blob)
            session.merge(Rendering(source_sha256=source, sha256=blob.sha256))
    except (SQLAlchemyError, StorageFull, StorageUnavailable) as error:
        log.warning("a rendered file is not kept: %s", error)
    return rendered


def render_apart(order: bytes) -> bytes:
    """Render an order in a process that ends."""
    command = [sys.executable, "-m", "service.press"]
    return subprocess.run(  # noqa: S603  our own module
        command, cwd=_ROOT, input=order, stdout=subprocess.PIPE, check=True, timeout=_WITHIN_S
    ).stdout
