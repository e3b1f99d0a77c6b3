"""Which files a campaign already has, by their hashes."""

from collections.abc import Sequence

from sqlalchemy import select
from sqlalchemy.orm import Session

from store.tables import Campaign, FrameRow


def find_known(session: Session, campaign: Campaign, hashes: Sequence[str]) -> dict[str, FrameRow]:
    """The campaign's frames with these bytes, by hash. A campaign has a file once."""
    rows = select(FrameRow).where(FrameRow.campaign_id == campaign.id, FrameRow.sha256.in_(set(hashes)))
    return {frame.sha256: frame for frame in session.scalars(rows)}
