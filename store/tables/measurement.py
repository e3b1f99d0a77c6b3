"""Measurements with calibrated cameras: each names the version that it was made with."""

from datetime import datetime

from sqlalchemy import ForeignKey, Index, String, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from store.columns import UtcDateTime, new_id, utc_now
from store.tables.base import Audited, Base, Json


class Measurement(Audited, Base):
    """One measurement, complete and immutable (triggers hold it)."""

    __tablename__ = "measurement"
    __audit_digests__ = frozenset({"result"})
    __table_args__ = (
        UniqueConstraint("frame_id", "content_sha256"),
        Index("ix_measurement_calibration_id", "calibration_id"),
        Index("ix_measurement_organisation_id_id", "organisation_id", "id"),
        Index("ix_measurement_campaign_id", "campaign_id"),
    )

    id: Mapped[str] = mapped_column(primary_key=True, default=lambda: new_id("msr"))
    organisation_id: Mapped[str] = mapped_column(ForeignKey("organisation.id"))
    campaign_id: Mapped[str] = mapped_column(ForeignKey("campaign.id"))
    frame_id: Mapped[str] = mapped_column(ForeignKey("frame.id"))
    calibration_id: Mapped[str] = mapped_column(ForeignKey("calibration.id"))
    method: Mapped[str]
    parameters: Mapped[Json]
    """What was asked for: region, grid, reflectance, products."""
    result: Mapped[Json]
    result_schema: Mapped[int]
    software: Mapped[Json]
    content_sha256: Mapped[str] = mapped_column(String(64))
    """Over frame, version, parameters and code version: the same content is the same measurement."""
    map_tif_sha256: Mapped[str | None] = mapped_column(ForeignKey("blob.sha256"))
    map_png_sha256: Mapped[str | None] = mapped_column(ForeignKey("blob.sha256"))
    created_by: Mapped[str]
    created_at: Mapped[datetime] = mapped_column(UtcDateTime, default=utc_now)
