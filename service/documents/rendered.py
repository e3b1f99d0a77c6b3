"""Rendered files: each is made in a process of its own, and kept under the hash of all that it is made of."""

import hashlib
import json
import logging
import subprocess
import threading
from contextlib import suppress
from typing import Any, Final

from sqlalchemy.exc import SQLAlchemyError

from service.http.context import Context
from store import blobs, files, software, tables
from store.sandbox import build_command, build_environment


def write_order(kind: str, **what: Any) -> bytes:  # noqa: ANN401  what JSON holds
    """Write what `rendering.py` is to render: a certificate with its preview, sheets, or a plot."""
    return json.dumps({"kind": kind, **what}, ensure_ascii=False, allow_nan=False).encode()


log = logging.getLogger(__name__)

_WITHIN_S: Final = 300.0
_MOST_BYTES: Final = 128 << 20
_MOST_SAID: Final = 1000
_THREADS: Final = {"RAYON_NUM_THREADS": "2"}  # of Typst: each keeps address space, which is limited


class RenderingFailed(Exception):  # noqa: N818  it says what happened
    """The process ended without the file: by its limits, or by an error of ours."""


def name_source(content: bytes) -> str:
    """Return the name that a file is kept under: the hash of what it shows and of how that is rendered."""
    return hashlib.sha256(software.RENDERER.encode() + b" " + content).hexdigest()


def find_rendered(context: Context, source: str) -> bytes | None:
    """Return the file that is kept, byte for byte; None if it was never made, or lost since."""
    with context.database.reading() as session:
        kept = session.get(tables.Rendering, source)
    if kept is None:
        return None
    try:
        return b"".join(context.files.open(kept.sha256)[1])
    except (blobs.BlobDamaged, blobs.StorageUnavailable) as fault:
        log.warning("a file is rendered again: %s", fault)
        return None


def render_and_keep(context: Context, source: str, order: bytes) -> bytes:
    rendered = render_apart(order, require=context.settings.decoder_sandbox == "require")
    try:
        blob = context.blobs.keep([rendered])
        with context.database.writing("rendering") as session:
            files.keep_blobs(session, [blob])
            session.merge(tables.Rendering(source_sha256=source, sha256=blob.sha256))
    except (SQLAlchemyError, blobs.StorageFull, blobs.StorageUnavailable) as error:
        log.warning("a rendered file is not kept: %s", error)
    return rendered


def render_apart(order: bytes, *, require: bool = False, first: bool = False) -> bytes:
    """Render in a process that ends, shut in (fully, with `require`); `first`: at the usual priority."""
    chosen = [name for name, wanted in (("--require", require), ("--first", first)) if wanted]
    process = subprocess.Popen(  # noqa: S603  our own module
        [*build_command("service.documents.rendering"), *chosen],
        env=build_environment() | _THREADS,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    )
    assert process.stdin is not None  # noqa: S101  narrows the type: both are pipes
    assert process.stdout is not None  # noqa: S101
    late = threading.Timer(_WITHIN_S, process.kill)
    late.start()
    try:
        with process:
            with suppress(BrokenPipeError), process.stdin:
                process.stdin.write(order)
            rendered = process.stdout.read(_MOST_BYTES)
            if process.stdout.read(1):
                process.kill()
    finally:
        late.cancel()
    if process.returncode:
        reason = rendered[-_MOST_SAID:].decode(errors="replace")
        raise RenderingFailed(f"exit code {process.returncode}: {reason}")
    return rendered
