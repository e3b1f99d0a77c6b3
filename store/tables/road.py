"""Roads whose illuminance is judged: what was stated of them, and each evaluation."""

from datetime import datetime
from typing import Any

from sqlalchemy import ForeignKey, Index, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from store.tables.base import Audited, Base, Json, Sha256, new_id, utc_now


class Road(Audited, Base):
    """One road on one night: its site, frames, control points, conditions and requirement."""

    __tablename__ = "road"
    __audit_digests__ = frozenset({"frames"})
    __table_args__ = (Index("ix_road_organisation_id_id", "organisation_id", "id"),)

    id: Mapped[str] = mapped_column(primary_key=True, default=lambda: new_id("roa"))
    organisation_id: Mapped[str] = mapped_column(ForeignKey("organisation.id"))
    name: Mapped[str]
    site: Mapped[Json]
    requirement: Mapped[Json]
    conditions: Mapped[Json]
    frames: Mapped[list[Any]]
    """A frame's id and its marks, each a place in the image and on the road."""
    points: Mapped[list[Any]] = mapped_column(default=list)
    """Control points as they were entered."""
    hidden: Mapped[list[str]] = mapped_column(
        default=list, doc="Names of grid points that a car or a tree hides, as a person marked them."
    )
    created_by: Mapped[str]
    created_at: Mapped[datetime] = mapped_column(default=utc_now)


class RoadResult(Audited, Base):
    """One evaluation of a road, complete and immutable (triggers hold it)."""

    __tablename__ = "road_result"
    __audit_digests__ = frozenset({"inputs", "result"})
    __table_args__ = (UniqueConstraint("road_id", "number"),)

    id: Mapped[str] = mapped_column(primary_key=True, default=lambda: new_id("rrs"))
    organisation_id: Mapped[str] = mapped_column(ForeignKey("organisation.id"))
    road_id: Mapped[str] = mapped_column(ForeignKey("road.id"))
    number: Mapped[int]
    inputs: Mapped[Json]
    """All that was stated of the road, and what was read in its frames."""
    result: Mapped[Json]
    result_schema: Mapped[int]
    software: Mapped[Json]
    content_sha256: Mapped[Sha256]
    map_png_sha256: Mapped[str | None] = mapped_column(ForeignKey("blob.sha256"))
    created_by: Mapped[str]
    created_at: Mapped[datetime] = mapped_column(default=utc_now)
