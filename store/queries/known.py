"""Which files a campaign or an organisation already has, by their hashes."""

from collections.abc import Iterable, Sequence

from sqlalchemy import select
from sqlalchemy.orm import Session

from store.tables import Blob, Campaign, FrameRow


def find_known(session: Session, campaign: Campaign, hashes: Sequence[str]) -> dict[str, FrameRow]:
    """The campaign's frames with these bytes, by hash; a withdrawn one is restored when it is sent again."""
    rows = select(FrameRow).where(FrameRow.campaign_id == campaign.id, FrameRow.sha256.in_(set(hashes)))
    rows = rows.where(FrameRow.withdrawn_at.is_(None))
    return {frame.sha256: frame for frame in session.scalars(rows)}


def find_known_anywhere(session: Session, organisation_id: str, hashes: Sequence[str]) -> list[FrameRow]:
    """Every frame of an organisation with these bytes, in the order in which they came."""
    rows = (
        select(FrameRow)
        .join(Campaign, Campaign.id == FrameRow.campaign_id)
        .where(Campaign.organisation_id == organisation_id, FrameRow.sha256.in_(set(hashes)))
        .order_by(FrameRow.id)
    )
    return list(session.scalars(rows))


def read_sizes(session: Session, hashes: Iterable[str]) -> dict[str, int]:
    """Return the size [bytes] in which each of these files was stored."""
    rows = session.execute(select(Blob.sha256, Blob.size_bytes).where(Blob.sha256.in_(set(hashes))))
    return {row[0]: row[1] for row in rows}
