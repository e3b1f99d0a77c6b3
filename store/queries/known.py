"""Which files a campaign already has, by their hashes."""

from collections.abc import Iterable, Sequence

from sqlalchemy import select
from sqlalchemy.orm import Session

from store.tables import Blob, Campaign, FrameRow


def find_known(session: Session, campaign: Campaign, hashes: Sequence[str]) -> dict[str, FrameRow]:
    """The campaign's frames with these bytes, by hash; a withdrawn one is restored when it is sent again."""
    rows = select(FrameRow).where(FrameRow.campaign_id == campaign.id, FrameRow.sha256.in_(set(hashes)))
    rows = rows.where(FrameRow.withdrawn_at.is_(None))
    return {frame.sha256: frame for frame in session.scalars(rows)}


def read_sizes(session: Session, hashes: Iterable[str]) -> dict[str, int]:
    """Return the size [bytes] in which each of these files was stored."""
    rows = session.execute(select(Blob.sha256, Blob.size_bytes).where(Blob.sha256.in_(set(hashes))))
    return {row[0]: row[1] for row in rows}
