"""The certificate as PDF: its sheets, set from one template, the same bytes for the same content."""

import base64
import hashlib
import json
import logging
import subprocess
import sys
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Final

from sqlalchemy.exc import SQLAlchemyError

from service.certificate.sheet import Node
from service.context import Context
from store.blobs import BlobDamaged, StorageFull, StorageUnavailable
from store.files import keep_blob
from store.tables import Rendering

log = logging.getLogger(__name__)

_SETTING: Final = Path(__file__).with_name("typesetter.py")
_WITHIN_S: Final = 300.0


def render_pdf(sheets: Node) -> bytes:
    """Set the sheets of `lay_out`, `lay_out_rig` or `lay_out_report` in a process of its own."""
    timestamp = int(datetime.fromisoformat(sheets["created_at"]).timestamp())
    template = sheets.get("template", "certificate.typ")
    request = json.dumps({"sheets": json.dumps(sheets), "timestamp": timestamp, "template": template})
    command = [sys.executable, "-I", str(_SETTING)]
    return subprocess.run(  # noqa: S603  our own script
        command, input=request.encode(), stdout=subprocess.PIPE, check=True, timeout=_WITHIN_S
    ).stdout


def find_pdf(context: Context, sheets: Node) -> bytes:
    """Return the PDF that is kept for this very content, or set it and keep it.

    A kept certificate keeps its bytes, whatever Typst sets later.
    """
    source = hashlib.sha256(json.dumps(sheets, sort_keys=True).encode()).hexdigest()
    with context.database.reading() as session:
        kept = session.get(Rendering, source)
    if kept is not None:
        try:
            return b"".join(context.files.open(kept.sha256)[1])
        except (BlobDamaged, StorageUnavailable) as fault:
            log.warning("a certificate is set again: %s", fault)
    pdf = render_pdf(sheets)
    try:
        with context.blobs.writer() as writer:
            writer.write(pdf)
            blob = writer.commit()
        with context.database.writing("certificate") as session:
            keep_blob(session, blob)
            session.merge(Rendering(source_sha256=source, sha256=blob.sha256))
    except (SQLAlchemyError, StorageFull, StorageUnavailable) as error:
        log.warning("a certificate is not kept: %s", error)
    return pdf


def draw_region(
    png: bytes,
    width_px: int,
    height_px: int,
    polygons: Sequence[Sequence[Sequence[float]]],
    *,
    thin: Sequence[Sequence[Sequence[float]]] = (),
    style: str = 'fill="#ffd400" fill-opacity="0.12" stroke="#ffd400"',
) -> str:
    """SVG of a frame's preview with the parts of its region on it, in the frame's own pixels."""
    picture = base64.b64encode(png).decode()
    stroke = max(width_px, height_px) / 300
    outlines = "".join(
        f'<polygon points="{" ".join(f"{x:g},{y:g}" for x, y in corners)}" {style} '
        f'stroke-width="{share * stroke:.2f}"/>'
        for share, drawn in ((1.0, polygons), (0.35, thin))
        for corners in drawn
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width_px} {height_px}">'
        f'<image href="data:image/png;base64,{picture}" width="{width_px}" height="{height_px}" '
        f'preserveAspectRatio="none"/>{outlines}</svg>'
    )
