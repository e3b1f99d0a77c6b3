"""Previews at the size of a grid's cell, kept in the database: a page shows hundreds of them at once."""

import io
from collections.abc import Collection, Mapping
from typing import Final

from PIL import Image
from sqlalchemy import select
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.orm import Session

from store.tables import SmallPreview

SIDE_PX: Final = 160


def reduce_preview(preview: bytes) -> bytes:
    """Return a frame's preview as WebP of at most 160 px, some 3 kB."""
    with Image.open(io.BytesIO(preview)) as opened:
        grey = opened.convert("L")
    grey.thumbnail((SIDE_PX, SIDE_PX), reducing_gap=2.0)
    out = io.BytesIO()
    grey.save(out, "WEBP", quality=80, method=2)
    return out.getvalue()


def find_small_previews(session: Session, hashes: Collection[str]) -> dict[str, bytes]:
    """Return those that are kept, by the hash of the preview."""
    columns = select(SmallPreview.preview_sha256, SmallPreview.webp)
    rows = session.execute(columns.where(SmallPreview.preview_sha256.in_(hashes)))
    return {row[0]: row[1] for row in rows}


def keep_small_previews(session: Session, pictures: Mapping[str, bytes]) -> None:
    """Keep pictures by the hash of their preview, unless somebody else has done so."""
    insert = sqlite.insert if session.get_bind().dialect.name == "sqlite" else postgresql.insert
    rows = [{"preview_sha256": sha256, "webp": pictures[sha256]} for sha256 in sorted(pictures)]
    session.execute(insert(SmallPreview).values(rows).on_conflict_do_nothing())
