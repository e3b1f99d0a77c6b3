"""Field work: campaigns, regions, readings, frames, statistics, checklists, and what is kept of them."""

from datetime import datetime
from typing import Any, ClassVar, Literal

from sqlalchemy import CheckConstraint, ColumnElement, ForeignKey, Index, String, UniqueConstraint, text
from sqlalchemy.orm import Mapped, mapped_column

from radiometry.specification.roles import ROLES
from store.blobs.proof import Damage
from store.tables import base

CampaignKind = Literal["calibration", "measurement"]
FrameState = Literal["received", "read", "extracted", "refused"]


class Campaign(base.Identified, base.Audited, base.Dated, base.Base, prefix="cmp"):
    __table_args__ = (
        base.one_of("kind", CampaignKind),
        CheckConstraint("surface_reflectance > 0 AND surface_reflectance <= 1", "surface_reflectance_share"),
    )

    organisation_id: Mapped[str] = mapped_column(ForeignKey("organisation.id"), index=True)
    camera_id: Mapped[str] = mapped_column(ForeignKey("camera.id"), index=True)
    method: Mapped[str] = mapped_column(String)
    kind: Mapped[str] = mapped_column(default="calibration")
    project_number: Mapped[str | None]
    recorder: Mapped[str | None]
    customer: Mapped[str | None]
    place: Mapped[str | None]
    conditions: Mapped[str | None]  # what bears on it: temperature, warm-up of the lamp, daylight kept out
    started_at: Mapped[datetime | None]
    ended_at: Mapped[datetime | None]
    time_zone: Mapped[str | None]  # of the camera's clock, for files without; None: the organisation's
    lens: Mapped[base.Json | None]  # make, model and serial number; None: that registered with the camera
    comments: Mapped[str | None]
    surface_reflectance: Mapped[float | None]  # of the taped rectangle: illuminance then checks luminance
    lamp: Mapped[str | None]  # spectrum of the calibration's lamp: a name of the library, or a table
    camera_response: Mapped[str | None]
    focus_distance_m: Mapped[float | None]
    focal_length_mm: Mapped[float | None]
    mains_frequency_hz: Mapped[float | None]
    lamp_modulation: Mapped[float | None]
    lamp_kind: Mapped[str | None]
    acceptance: Mapped[str | None]  # decision rule of the verdict; None is the simple one
    roi_id: Mapped[str | None] = mapped_column(
        ForeignKey("roi.id"), doc="Of the region in use; absent while none is set."
    )
    panel_id: Mapped[str | None] = mapped_column(ForeignKey("panel.id"))
    """Of a reflectance campaign; None leaves the choice to what the files and the records say."""
    target: Mapped[base.Json | None]  # what is photographed, where a method must know it: a board, an edge
    archived_at: Mapped[datetime | None]

    @property
    def measures(self) -> bool:
        return self.kind == "measurement"


class Roi(base.Identified, base.Audited, base.Dated, base.Owned, base.Base, prefix="roi"):
    """A region, never changed: another polygon is another row, so that older statistics keep theirs."""

    __table_args__ = (UniqueConstraint("organisation_id", "sha256"),)

    sha256: Mapped[base.Sha256]
    points: Mapped[list[Any]]  # corners; of several parts together those of the rectangle around them
    parts: Mapped[list[Any] | None]  # name and points of each, if several


class Withdrawable:
    """Rows of a campaign that are withdrawn, never deleted."""

    campaign_id: Mapped[str]
    withdrawn_at: Mapped[datetime | None]

    @classmethod
    def standing(cls, campaign_id: str) -> ColumnElement[bool]:
        return (cls.campaign_id == campaign_id) & cls.withdrawn_at.is_(None)


class Reading(Withdrawable, base.Identified, base.Audited, base.Dated, base.Base, prefix="rdg"):
    __table_args__ = (
        CheckConstraint("quantity IN ('luminance', 'illuminance')", "quantity_known"),
        CheckConstraint("value > 0", "value_positive"),
    )

    campaign_id: Mapped[str] = mapped_column(ForeignKey("campaign.id"), index=True)
    scene: Mapped[str]
    quantity: Mapped[str]
    value: Mapped[float] = mapped_column(doc="In SI: cd/m2 or lx.")
    entered_value: Mapped[float]
    entered_unit: Mapped[str]
    meter_id: Mapped[str | None] = mapped_column(ForeignKey("meter.id"))
    taken_at: Mapped[datetime | None]
    reason: Mapped[str | None]  # why it is right although its frames speak against it
    withdrawn_at: Mapped[datetime | None]  # mistyped: withdrawn, not deleted


class Blob(base.Dated, base.Base):
    """Bytes that the blob store keeps under their hash."""

    __table_args__ = (
        CheckConstraint("size_bytes >= 0", "size_not_negative"),
        CheckConstraint("damage IN ('damaged', 'missing')", "damage_known"),
        Index("ix_blob_proven_at", "proven_at"),
        base.index_some("ix_blob_damage", "damage", where=text("damage IS NOT NULL")),
    )

    sha256: Mapped[base.Sha256] = mapped_column(primary_key=True)
    size_bytes: Mapped[base.BigInt]
    digests: Mapped[bytes | None] = mapped_column(deferred=True)  # one per MiB; None until it was proven once
    proven_at: Mapped[datetime] = mapped_column(default=base.utc_now)  # all of it hashed to its name
    damage: Mapped[Damage | None] = mapped_column(String, default=None)
    """Since it was found other than it was stored; the same upload ends that."""


class FrameRow(Withdrawable, base.Identified, base.Audited, base.Dated, base.Base, prefix="frm"):
    """One uploaded file in one campaign."""

    __audit_digests__: ClassVar[frozenset[str]] = frozenset({"header", "proof"})
    __table_args__ = (
        UniqueConstraint("campaign_id", "sha256"),
        base.one_of("role", Literal[tuple(role.name for role in ROLES)]),
        base.one_of("state", FrameState),
        CheckConstraint("(state = 'refused') = (refusal_code IS NOT NULL)", "refused_says_why"),
        CheckConstraint("exposure_time_s > 0 AND f_number > 0 AND iso > 0", "exposure_positive"),
        Index("ix_frame_sha256", "sha256"),
        Index("ix_frame_campaign_id_id", "campaign_id", "id"),
        Index("ix_frame_counted", "campaign_id", "state", "withdrawn_at"),
        base.index_some(
            "ix_frame_not_extracted", "state", "refusal_code", where=text("state <> 'extracted'")
        ),
    )

    campaign_id: Mapped[str] = mapped_column(ForeignKey("campaign.id"))
    sha256: Mapped[str] = mapped_column(ForeignKey("blob.sha256"))
    filename: Mapped[str]
    role: Mapped[str]
    scene: Mapped[str | None]
    roi_id: Mapped[str | None] = mapped_column(ForeignKey("roi.id"))  # its own, where the camera has moved
    found: Mapped[base.Json | None]  # by itself: ``roi_id`` of a panel, and its ``serial`` as its code says
    supplied: Mapped[base.Json] = mapped_column(default=dict)  # exposure typed in, where the file states none
    state: Mapped[str] = mapped_column(default="received")
    header: Mapped[base.Json | None]
    proof: Mapped[base.Json | None]  # of its pixels; None: nobody has read them all
    exposure: Mapped[base.Json | None]  # the three values in use, and their origins
    exposure_time_s: Mapped[float | None]
    f_number: Mapped[float | None]
    iso: Mapped[float | None]
    warnings: Mapped[list[str]] = mapped_column(default=list)
    refusal_code: Mapped[str | None]
    refusal_detail: Mapped[str | None]
    preview_sha256: Mapped[str | None] = mapped_column(ForeignKey("blob.sha256"))
    left_out: Mapped[base.Json | None]  # ``reason`` and ``by``: of no fit any more
    withdrawn_at: Mapped[datetime | None]  # it no longer belongs to its campaign; it can be restored

    @property
    def size_px(self) -> tuple[int, int] | None:
        """Width and height of a frame that has been read."""
        return (self.header["width_px"], self.header["height_px"]) if self.header else None


class Extraction(base.Identified, base.Audited, base.Dated, base.Base, prefix="ext"):
    """The statistics of one frame in one region by one version of the code: made once, never changed."""

    __audit_digests__: ClassVar[frozenset[str]] = frozenset({"features"})
    __table_args__ = (UniqueConstraint("frame_id", "roi_id", "extractor"),)

    frame_id: Mapped[str] = mapped_column(ForeignKey("frame.id"))
    roi_id: Mapped[str] = mapped_column(ForeignKey("roi.id"))
    extractor: Mapped[str]
    features: Mapped[base.Json | None]  # the method's own, beside the statistics


class ChannelRow(base.AuditedTogether, base.Base):
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


class Crop(base.Identified, base.Dated, base.Owned, base.Base, prefix="crp"):
    """A picture that can be drawn again from its frame; derived, so never audited."""

    __table_args__ = (
        Index("ix_crop_frame_id_asked", "frame_id", "asked"),
        Index("ix_crop_organisation_id_id", "organisation_id", "id"),
    )

    frame_id: Mapped[str] = mapped_column(ForeignKey("frame.id"))
    asked: Mapped[str]
    job_id: Mapped[str] = mapped_column(ForeignKey("job.id"))
    png: Mapped[bytes]


class CampaignReview(base.Base):
    """List of what a campaign still lacks, and the revision of the campaign that it was computed from."""

    __table_args__ = (
        base.index_some("ix_campaign_review_stale", "not_before", where=text("kept_revision < revision")),
    )

    campaign_id: Mapped[str] = mapped_column(ForeignKey("campaign.id"), primary_key=True)
    revision: Mapped[base.BigInt] = mapped_column(
        default=0
    )  # rises with what it depends on (store/revisions.py)
    whole_revision: Mapped[base.BigInt] = mapped_column(
        default=0
    )  # last that may have changed any of its frames
    kept_revision: Mapped[base.BigInt] = mapped_column(
        default=-1
    )  # from which rest and verdicts were computed
    kept_by: Mapped[str | None]  # hash of the code that computed them: another code computes them again
    not_before: Mapped[datetime | None]  # one computes them, or has just done so and it took long
    missing: Mapped[list[Any] | None]
    advice: Mapped[list[Any] | None]
    gaps: Mapped[list[Any] | None]
    findings: Mapped[list[Any] | None]
    checklist: Mapped[base.Json | None]  # what the record says of each item, and since when each part is so


class FrameVerdict(base.Base):
    """Reasons of the verdict on one frame, from the same revision; a frame that passes has no row."""

    # no foreign keys: checking one takes a lock on the frame, whose own writer waits for the review's row
    frame_id: Mapped[str] = mapped_column(primary_key=True)
    campaign_id: Mapped[str] = mapped_column(index=True)
    reasons: Mapped[str]  # JSON: code, outcome and detail of each


class FrameChange(base.Base):
    """Revision of the campaign at which a frame, its statistics or the verdict on it last changed."""

    __table_args__ = (Index("ix_frame_change_campaign_id_revision", "campaign_id", "revision"),)

    # no foreign keys, as for its verdict
    frame_id: Mapped[str] = mapped_column(primary_key=True)
    campaign_id: Mapped[str]
    revision: Mapped[base.BigInt]


class SmallPreview(base.Base):
    """A frame's preview at the size of a grid's cell."""

    # no foreign key: it is kept before the frame that shows it, and holds nothing that its preview does not
    preview_sha256: Mapped[base.Sha256] = mapped_column(primary_key=True)
    webp: Mapped[bytes]


class Rendering(base.Dated, base.Base):
    """A certificate, a report or a version's plot as it was rendered: the same content is rendered once."""

    source_sha256: Mapped[base.Sha256] = mapped_column(primary_key=True)  # of all that goes in, and how
    sha256: Mapped[str] = mapped_column(ForeignKey("blob.sha256"))


class Manifest(base.Identified, base.Audited, base.Dated, base.Owned, base.Base, prefix="man"):
    """Contents of a card, as the sender lists them; never changed."""

    __audit_digests__: ClassVar[frozenset[str]] = frozenset({"files", "others"})
    __table_args__ = (
        UniqueConstraint("campaign_id", "sha256"),
        Index("ix_manifest_campaign_id_id", "campaign_id", "id"),
    )

    campaign_id: Mapped[str] = mapped_column(ForeignKey("campaign.id"))
    sha256: Mapped[base.Sha256]  # of both lists in JSON: the same card, the same row
    files: Mapped[list[Any]]
    others: Mapped[list[Any]]  # files of the card that are not sent


class SigningKey(base.Audited, base.Dated, base.Base):
    """A public key of this service; none is ever removed, so that old receipts can be verified."""

    id: Mapped[str] = mapped_column(primary_key=True)
    public_key: Mapped[str]  # PEM


class ChecklistTick(base.Audited, base.Base):
    """An item of the procedure's checklist that somebody has ticked; unticking empties who and when."""

    __table_args__ = (CheckConstraint("(done_by IS NULL) = (done_at IS NULL)", "who_and_when"),)

    campaign_id: Mapped[str] = mapped_column(ForeignKey("campaign.id"), primary_key=True)
    key: Mapped[str] = mapped_column(primary_key=True)
    done_by: Mapped[str | None]
    done_at: Mapped[datetime | None]
    note: Mapped[str | None]


class ChecklistSignature(base.Audited, base.Base):
    """The operator's signature below a campaign's checklist."""

    campaign_id: Mapped[str] = mapped_column(ForeignKey("campaign.id"), primary_key=True)
    name: Mapped[str]
    signed_by: Mapped[str]  # the key that signed
    signed_at: Mapped[datetime] = mapped_column(default=base.utc_now)
    state_sha256: Mapped[base.Sha256 | None]  # of details, frames, readings and region as they were signed


class Recall(base.Identified, base.Audited, base.Dated, base.Base, prefix="prg"):
    """All versions made with something that turned out wrong: proposed, reviewed, revoked as one step."""

    __tablename__ = "purge"
    __table_args__ = (CheckConstraint("(confirmed_by IS NULL) = (confirmed_at IS NULL)", "who_and_when"),)

    organisation_id: Mapped[str] = mapped_column(ForeignKey("organisation.id"), index=True)
    cause: Mapped[base.Json]
    reason: Mapped[str]
    calibration_ids: Mapped[list[Any]]  # as reviewed: confirming revokes these, or refuses others found since
    created_by: Mapped[str]
    confirmed_by: Mapped[str | None]
    confirmed_at: Mapped[datetime | None]
