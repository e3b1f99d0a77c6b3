"""Manifests of cards beside what a campaign has stored."""

import json
from collections.abc import Mapping
from typing import Any

from sqlalchemy import Row, select
from sqlalchemy.orm import Session

from store.tables import Blob, Campaign, FrameRow, Manifest


def write_canonical(value: object) -> bytes:
    """Return text, integers, lists, and objects with names in ASCII, as RFC 8785 spells them."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False).encode()


def find_manifest(session: Session, campaign: Campaign, manifest_id: str | None) -> Manifest | None:
    """Return a campaign's manifest with this id, else its newest."""
    rows = select(Manifest).where(Manifest.campaign_id == campaign.id)
    if manifest_id is not None:
        rows = rows.where(Manifest.id == manifest_id)
    return session.scalar(rows.order_by(Manifest.id.desc()).limit(1))


def read_stored(session: Session, campaign_id: str, hashes: set[str]) -> Mapping[str, Row[Any]]:
    """Return the campaign's frames with these bytes and their files, withdrawn and refused ones included."""
    rows = session.execute(
        select(
            FrameRow.sha256,
            FrameRow.id.label("frame_id"),
            FrameRow.state,
            FrameRow.refusal_code,
            FrameRow.withdrawn_at,
            FrameRow.created_at.label("received_at"),
            Blob.size_bytes,
            Blob.proven_at.label("hash_checked_at"),
        )
        .join(Blob, Blob.sha256 == FrameRow.sha256)
        .where(FrameRow.campaign_id == campaign_id)
    )
    found: list[Row[Any]] = list(rows)  # type: ignore[arg-type]
    return {row.sha256: row for row in found if row.sha256 in hashes}
