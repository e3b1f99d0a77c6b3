"""Tables of field work: campaigns, their regions, meter readings, frames and frame statistics."""

from datetime import datetime
from typing import Any, ClassVar

from sqlalchemy import BigInteger, CheckConstraint, ForeignKey, Index, String, UniqueConstraint, text
from sqlalchemy.orm import Mapped, mapped_column

from store.blobs.errors import Damage
from store.columns import UtcDateTime, new_id, utc_now
from store.tables.base import Audited, AuditedTogether, Base, Json


class Campaign(Audited, Base):
    """A campaign of one camera and one method.

    Attributes
    ----------
    kind : str
        "calibration", or "measurement" for a night whose frames no fit uses.
    roi_id : str or None
        Of the region in use; absent while none is set.
    """

    __tablename__ = "campaign"
    __table_args__ = (
        CheckConstraint("kind IN ('calibration', 'measurement')", "kind_known"),
        CheckConstraint("surface_reflectance > 0 AND surface_reflectance <= 1", "surface_reflectance_share"),
    )

    id: Mapped[str] = mapped_column(primary_key=True, default=lambda: new_id("cmp"))
    organisation_id: Mapped[str] = mapped_column(ForeignKey("organisation.id"), index=True)
    camera_id: Mapped[str] = mapped_column(ForeignKey("camera.id"), index=True)
    method: Mapped[str] = mapped_column(String)
    kind: Mapped[str] = mapped_column(default="calibration")
    project_number: Mapped[str | None]
    recorder: Mapped[str | None]
    customer: Mapped[str | None]
    place: Mapped[str | None]
    conditions: Mapped[str | None]
    """What surrounded the work and may bear on it: temperature, warm-up of the lamp, daylight kept out."""
    started_at: Mapped[datetime | None] = mapped_column(UtcDateTime)
    ended_at: Mapped[datetime | None] = mapped_column(UtcDateTime)
    time_zone: Mapped[str | None]
    """Of the clock of the camera, for files without an offset; None for the organisation's."""
    lens: Mapped[Json | None] = mapped_column(default=None)
    """Make, model and serial number; None for the lens that is registered with the camera."""
    comments: Mapped[str | None]
    surface_reflectance: Mapped[float | None]
    """rho of the taped rectangle, where known: lets illuminance readings check luminance readings."""
    lamp: Mapped[str | None]
    """Spectrum of the calibration's lamp: a name of the library, or a table."""
    camera_response: Mapped[str | None]
    focus_distance_m: Mapped[float | None]
    focal_length_mm: Mapped[float | None]
    mains_frequency_hz: Mapped[float | None]
    lamp_modulation: Mapped[float | None]
    lamp_kind: Mapped[str | None] = mapped_column(default=None)
    acceptance: Mapped[str | None]
    """Decision rule of the verdict; None is the simple one."""
    roi_id: Mapped[str | None] = mapped_column(ForeignKey("roi.id"))
    panel_id: Mapped[str | None] = mapped_column(ForeignKey("panel.id"))
    """Of a reflectance campaign; None leaves the choice to what the files and the records say."""
    target: Mapped[Json | None] = mapped_column(default=None)
    """What is photographed, where the method must know it to read a frame: a board, an edge."""
    archived_at: Mapped[datetime | None] = mapped_column(UtcDateTime)
    created_at: Mapped[datetime] = mapped_column(UtcDateTime, default=utc_now)

    @property
    def measures(self) -> bool:
        """Return True for a night of measurements."""
        return self.kind == "measurement"


class Roi(Audited, Base):
    """A region, never changed: another polygon is another row, so that older statistics keep theirs."""

    __tablename__ = "roi"
    __table_args__ = (UniqueConstraint("organisation_id", "sha256"),)

    id: Mapped[str] = mapped_column(primary_key=True, default=lambda: new_id("roi"))
    organisation_id: Mapped[str] = mapped_column(ForeignKey("organisation.id"))
    sha256: Mapped[str] = mapped_column(String(64))
    points: Mapped[list[Any]]
    """Corners; of several parts together those of the rectangle around them."""
    parts: Mapped[list[Any] | None] = mapped_column(default=None)
    """Name and points of each part, where there are several."""
    created_at: Mapped[datetime] = mapped_column(UtcDateTime, default=utc_now)


class Reading(Audited, Base):
    """One meter reading of one scene.

    Attributes
    ----------
    value : float
        In SI: cd/m2 or lx.
    """

    __tablename__ = "reading"
    __table_args__ = (
        CheckConstraint("quantity IN ('luminance', 'illuminance')", "quantity_known"),
        CheckConstraint("value > 0", "value_positive"),
    )

    id: Mapped[str] = mapped_column(primary_key=True, default=lambda: new_id("rdg"))
    campaign_id: Mapped[str] = mapped_column(ForeignKey("campaign.id"), index=True)
    scene: Mapped[str]
    quantity: Mapped[str]
    value: Mapped[float]
    entered_value: Mapped[float]
    entered_unit: Mapped[str]
    meter_id: Mapped[str | None] = mapped_column(ForeignKey("meter.id"))
    taken_at: Mapped[datetime | None] = mapped_column(UtcDateTime)
    created_at: Mapped[datetime] = mapped_column(UtcDateTime, default=utc_now)
    withdrawn_at: Mapped[datetime | None] = mapped_column(UtcDateTime)
    """A mistyped reading is withdrawn, not deleted."""


class Blob(Base):
    """Bytes that the blob store keeps under their hash."""

    __tablename__ = "blob"
    __table_args__ = (
        CheckConstraint("size_bytes >= 0", "size_not_negative"),
        CheckConstraint("damage IN ('damaged', 'missing')", "damage_known"),
        Index("ix_blob_proven_at", "proven_at"),
        Index(
            "ix_blob_damage",
            "damage",
            sqlite_where=text("damage IS NOT NULL"),
            postgresql_where=text("damage IS NOT NULL"),
        ),
    )

    sha256: Mapped[str] = mapped_column(String(64), primary_key=True)
    size_bytes: Mapped[int] = mapped_column(BigInteger)
    digests: Mapped[bytes | None] = mapped_column(default=None, deferred=True)
    """One per MiB, joined (store/digests.py); None until a blob of an older stilb has been proven once."""
    proven_at: Mapped[datetime] = mapped_column(UtcDateTime, default=utc_now)
    """When all of it was last found to hash to its name."""
    damage: Mapped[Damage | None] = mapped_column(String, default=None)
    """Since it was found other than it was stored; the same upload ends that."""
    created_at: Mapped[datetime] = mapped_column(UtcDateTime, default=utc_now)


class FrameRow(Audited, Base):
    """One uploaded file in one campaign."""

    __tablename__ = "frame"
    __audit_digests__: ClassVar[frozenset[str]] = frozenset({"header", "proof"})
    __table_args__ = (
        UniqueConstraint("campaign_id", "sha256"),
        CheckConstraint("role IN ('light', 'dark', 'flat', 'panel', 'chart', 'field')", "role_known"),
        CheckConstraint("state IN ('received', 'read', 'extracted', 'refused')", "state_known"),
        CheckConstraint("(state = 'refused') = (refusal_code IS NOT NULL)", "refused_says_why"),
        CheckConstraint("exposure_time_s > 0 AND f_number > 0 AND iso > 0", "exposure_positive"),
        Index("ix_frame_sha256", "sha256"),
        Index("ix_frame_campaign_id_id", "campaign_id", "id"),
        Index("ix_frame_counted", "campaign_id", "state", "withdrawn_at"),
        Index(
            "ix_frame_not_extracted",
            "state",
            "refusal_code",
            sqlite_where=text("state <> 'extracted'"),
            postgresql_where=text("state <> 'extracted'"),
        ),
    )

    id: Mapped[str] = mapped_column(primary_key=True, default=lambda: new_id("frm"))
    campaign_id: Mapped[str] = mapped_column(ForeignKey("campaign.id"))
    sha256: Mapped[str] = mapped_column(ForeignKey("blob.sha256"))
    filename: Mapped[str]
    role: Mapped[str]
    scene: Mapped[str | None]
    roi_id: Mapped[str | None] = mapped_column(ForeignKey("roi.id"))
    """Its own region, where the camera has moved; else the campaign's."""
    found: Mapped[Json | None] = mapped_column(default=None)
    """Found in it automatically: ``roi_id`` of a panel, and its ``serial`` as its code says."""
    supplied: Mapped[Json] = mapped_column(default=dict)
    """Exposure values typed in with the frame, for what the file does not say."""
    state: Mapped[str] = mapped_column(default="received")
    header: Mapped[Json | None] = mapped_column(default=None)
    proof: Mapped[Json | None] = mapped_column(default=None)
    """What vouches for its pixels; None while nobody has read all of them."""
    exposure: Mapped[Json | None] = mapped_column(default=None)
    """The three values in use and the origin of each."""
    exposure_time_s: Mapped[float | None]
    f_number: Mapped[float | None]
    iso: Mapped[float | None]
    warnings: Mapped[list[str]] = mapped_column(default=list)
    refusal_code: Mapped[str | None]
    refusal_detail: Mapped[str | None]
    preview_sha256: Mapped[str | None] = mapped_column(ForeignKey("blob.sha256"))
    left_out: Mapped[Json | None] = mapped_column(default=None)
    """``reason`` and ``by`` where a person excluded it from every fit."""
    withdrawn_at: Mapped[datetime | None] = mapped_column(UtcDateTime)
    """Of a frame that no longer belongs to its campaign; it can be restored."""
    created_at: Mapped[datetime] = mapped_column(UtcDateTime, default=utc_now)

    @property
    def size_px(self) -> tuple[int, int] | None:
        """Width and height of a frame that has been read."""
        return (self.header["width_px"], self.header["height_px"]) if self.header else None


class Extraction(Audited, Base):
    """The statistics of one frame in one region by one version of the code: made once, never changed."""

    __tablename__ = "extraction"
    __audit_digests__: ClassVar[frozenset[str]] = frozenset({"features"})
    __table_args__ = (UniqueConstraint("frame_id", "roi_id", "extractor"),)

    id: Mapped[str] = mapped_column(primary_key=True, default=lambda: new_id("ext"))
    frame_id: Mapped[str] = mapped_column(ForeignKey("frame.id"))
    roi_id: Mapped[str] = mapped_column(ForeignKey("roi.id"))
    extractor: Mapped[str]
    features: Mapped[Json | None] = mapped_column(default=None)
    """The method's own figures beside the statistics."""
    created_at: Mapped[datetime] = mapped_column(UtcDateTime, default=utc_now)


class ChannelRow(AuditedTogether, Base):
    """One channel's row of an extraction."""

    __tablename__ = "channel_statistics"
    __table_args__ = (
        CheckConstraint("n > 0", "n_positive"),
        CheckConstraint("min_dn <= max_dn", "range_ordered"),
        CheckConstraint("saturated_share BETWEEN 0 AND 1 AND zero_share BETWEEN 0 AND 1", "shares"),
    )

    extraction_id: Mapped[str] = mapped_column(ForeignKey("extraction.id"), primary_key=True)
    channel: Mapped[str] = mapped_column(primary_key=True)
    n: Mapped[int]
    min_dn: Mapped[int]
    max_dn: Mapped[int]
    mean_dn: Mapped[float]
    median_dn: Mapped[float]
    std_dn: Mapped[float]
    saturated_share: Mapped[float]
    zero_share: Mapped[float]
    black_level_dn: Mapped[float]
    white_level_dn: Mapped[float]
