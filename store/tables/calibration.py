"""Calibration versions, which never change, what was published and measured with them, and roads."""

from datetime import datetime
from typing import Any

from sqlalchemy import CheckConstraint, ForeignKey, Index, String, UniqueConstraint, text
from sqlalchemy.orm import Mapped, mapped_column

from store.tables import base


class Calibration(base.Identified, base.Audited, base.Dated, base.Base, prefix="cal"):
    """One version, complete and immutable (triggers hold it). Its state follows from publications."""

    __table_args__ = (
        UniqueConstraint("camera_id", "method", "version"),
        UniqueConstraint("campaign_id", "content_sha256"),
        CheckConstraint("version >= 1", "version_counts_from_1"),
    )
    __audit_digests__ = frozenset({"result", "inputs"})

    organisation_id: Mapped[str] = mapped_column(ForeignKey("organisation.id"), index=True)
    camera_id: Mapped[str] = mapped_column(ForeignKey("camera.id"))
    campaign_id: Mapped[str] = mapped_column(ForeignKey("campaign.id"))
    method: Mapped[str] = mapped_column(String)
    version: Mapped[int]
    configuration: Mapped[base.Json]
    parameters: Mapped[base.Json]
    inputs: Mapped[base.Json]
    result: Mapped[base.Json]
    result_schema: Mapped[int]
    software: Mapped[base.Json] = mapped_column(
        doc="The fit code version (`stilb`), the release (`release`) and the packages that fitted."
    )
    content_sha256: Mapped[base.Sha256]  # over inputs, parameters, code: the same content, the same version
    created_by: Mapped[str]


class CoefficientRow(base.AuditedTogether, base.Base):
    __table_args__ = (CheckConstraint("standard_uncertainty >= 0", "uncertainty_not_negative"),)

    calibration_id: Mapped[str] = mapped_column(ForeignKey("calibration.id"), primary_key=True)
    position: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[str]
    value: Mapped[float]
    standard_uncertainty: Mapped[float]
    unit: Mapped[str]
    iso: Mapped[float | None]
    f_number: Mapped[float | None]
    band: Mapped[str | None]
    channel: Mapped[str | None]
    model: Mapped[str]
    flags: Mapped[list[str]]


class Slot(base.Base):
    """A camera's method in one configuration, which at most one published version may hold at any time."""

    __table_args__ = (UniqueConstraint("camera_id", "method", "configuration"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    camera_id: Mapped[str] = mapped_column(ForeignKey("camera.id"))
    method: Mapped[str]
    configuration: Mapped[str]


class Publication(base.Identified, base.Audited, base.Base, prefix="pub"):
    """A version in force in [valid_from, valid_to), as known in [known_from, known_to): bitemporal.

    A row is only ever closed; the database holds that no two of a slot overlap in both times.
    """

    __table_args__ = (
        CheckConstraint("valid_to IS NULL OR valid_from < valid_to", "validity_not_empty"),
        CheckConstraint("known_to IS NULL OR known_from <= known_to", "knowledge_ordered"),
        Index("ix_publication_slot_id", "slot_id"),
        Index("ix_publication_calibration_id", "calibration_id"),
        base.index_some(
            "ix_publication_in_force",
            "calibration_id",
            where=text("known_to IS NULL AND superseded_by IS NULL"),
        ),
    )

    slot_id: Mapped[int] = mapped_column(ForeignKey("slot.id"))
    calibration_id: Mapped[str] = mapped_column(ForeignKey("calibration.id"))
    valid_from: Mapped[datetime]
    valid_to: Mapped[datetime | None]
    known_from: Mapped[datetime]
    known_to: Mapped[datetime | None]
    reason: Mapped[str]
    superseded_by: Mapped[str | None] = mapped_column(ForeignKey("calibration.id"))  # by whom it was closed


class Revocation(base.Audited, base.Base):
    calibration_id: Mapped[str] = mapped_column(ForeignKey("calibration.id"), primary_key=True)
    reason: Mapped[str]
    revoked_by: Mapped[str]
    revoked_at: Mapped[datetime] = mapped_column(default=base.utc_now)


class IssuedCertificate(base.Audited, base.Base):
    """A certificate as it was issued when a version was published (triggers hold it)."""

    calibration_id: Mapped[str] = mapped_column(ForeignKey("calibration.id"), primary_key=True)
    amendment: Mapped[int] = mapped_column(
        primary_key=True,
        autoincrement=False,
        doc="0 of the original; each later publication of the version issues the next one beside it.",
    )
    number: Mapped[str]
    publication_id: Mapped[str] = mapped_column(ForeignKey("publication.id"))
    json_sha256: Mapped[str] = mapped_column(ForeignKey("blob.sha256"))
    pdf_sha256: Mapped[str] = mapped_column(ForeignKey("blob.sha256"))
    fitted_by: Mapped[base.Json | None]  # name and role; None of a key without a person
    approved_by: Mapped[base.Json | None]  # likewise; nobody has signed a certificate without
    at_upgrade: Mapped[bool] = mapped_column(
        doc="Whether the version was published before certificates were kept: "
        "its certificate was issued later."
    )
    issued_at: Mapped[datetime]


class Measurement(base.Identified, base.Audited, base.Dated, base.Owned, base.Base, prefix="msr"):
    """One measurement, complete and immutable (triggers hold it)."""

    __audit_digests__ = frozenset({"result"})
    __table_args__ = (
        UniqueConstraint("frame_id", "content_sha256"),
        Index("ix_measurement_calibration_id", "calibration_id"),
        Index("ix_measurement_organisation_id_id", "organisation_id", "id"),
        Index("ix_measurement_campaign_id", "campaign_id"),
    )

    campaign_id: Mapped[str] = mapped_column(ForeignKey("campaign.id"))
    frame_id: Mapped[str] = mapped_column(ForeignKey("frame.id"))
    calibration_id: Mapped[str] = mapped_column(ForeignKey("calibration.id"))
    method: Mapped[str]
    parameters: Mapped[base.Json]  # what was asked for: region, grid, reflectance, products
    result: Mapped[base.Json]
    result_schema: Mapped[int]
    software: Mapped[base.Json]
    content_sha256: Mapped[base.Sha256]  # over frame, version, parameters, code: the same, the same row
    map_tif_sha256: Mapped[str | None] = mapped_column(ForeignKey("blob.sha256"))
    map_png_sha256: Mapped[str | None] = mapped_column(ForeignKey("blob.sha256"))
    created_by: Mapped[str]


class ReadyRow(base.Base):
    """A publication with what a look-up and a series ask it for, one row for each."""

    __table_args__ = (
        Index("ix_ready_slot_id_valid_from", "slot_id", "valid_from"),
        base.index_some("ix_ready_slot_id_now", "slot_id", "valid_from", where=text("known_to IS NULL")),
        Index("ix_ready_series", "organisation_id", "camera_id", "valid_from", "method", "publication_id"),
    )

    publication_id: Mapped[str] = mapped_column(ForeignKey("publication.id"), primary_key=True)
    slot_id: Mapped[int] = mapped_column(ForeignKey("slot.id"))
    organisation_id: Mapped[str]
    camera_id: Mapped[str]
    campaign_id: Mapped[str]
    method: Mapped[str]
    calibration_id: Mapped[str]
    version: Mapped[int]
    computed_at: Mapped[datetime]
    valid_from: Mapped[datetime]
    valid_to: Mapped[datetime | None]
    known_from: Mapped[datetime]
    known_to: Mapped[datetime | None]
    coefficients: Mapped[int]  # how many coefficients the version has


class ReadyAnswer(base.Base):
    publication_id: Mapped[str] = mapped_column(ForeignKey("ready.publication_id"), primary_key=True)
    etag: Mapped[str]
    whole: Mapped[bool]
    foreseen: Mapped[str | None]
    items: Mapped[bytes]


class ReadyCells(base.Base):
    """The coefficients of a publication as rows of a series: CSV records, a line each, in their order."""

    publication_id: Mapped[str] = mapped_column(ForeignKey("ready.publication_id"), primary_key=True)
    cells: Mapped[str]


class MeasuredRow(base.Base):
    __table_args__ = (
        Index("ix_measured_organisation_id", "organisation_id", "taken_from", "measurement_id"),
        Index("ix_measured_camera_id", "camera_id", "taken_from", "measurement_id"),
        Index("ix_measured_campaign_id", "campaign_id", "taken_from", "measurement_id"),
    )

    measurement_id: Mapped[str] = mapped_column(ForeignKey("measurement.id"), primary_key=True)
    organisation_id: Mapped[str]
    camera_id: Mapped[str]
    campaign_id: Mapped[str]
    calibration_id: Mapped[str]
    corrector_id: Mapped[str | None]  # version that corrected the frame's vignetting, where one did
    taken_from: Mapped[datetime]
    taken_to: Mapped[datetime | None]
    created_at: Mapped[datetime]
    cells: Mapped[str]


class Road(base.Identified, base.Audited, base.Dated, base.Owned, base.Base, prefix="roa"):
    """One road on one night: its site, frames, control points, conditions and requirement."""

    __audit_digests__ = frozenset({"frames"})
    __table_args__ = (Index("ix_road_organisation_id_id", "organisation_id", "id"),)

    name: Mapped[str]
    site: Mapped[base.Json]
    requirement: Mapped[base.Json]
    conditions: Mapped[base.Json]
    frames: Mapped[list[Any]]
    """A frame's id and its marks, each a place in the image and on the road."""
    points: Mapped[list[Any]] = mapped_column(default=list)
    """Control points as they were entered."""
    hidden: Mapped[list[str]] = mapped_column(
        default=list, doc="Names of grid points that a car or a tree hides, as a person marked them."
    )
    created_by: Mapped[str]


class RoadResult(base.Identified, base.Audited, base.Dated, base.Owned, base.Base, prefix="rrs"):
    """One evaluation of a road, complete and immutable (triggers hold it)."""

    __audit_digests__ = frozenset({"inputs", "result"})
    __table_args__ = (UniqueConstraint("road_id", "number"),)

    road_id: Mapped[str] = mapped_column(ForeignKey("road.id"))
    number: Mapped[int]
    inputs: Mapped[base.Json]
    """All that was stated of the road, and what was read in its frames."""
    result: Mapped[base.Json]
    result_schema: Mapped[int]
    software: Mapped[base.Json]
    content_sha256: Mapped[base.Sha256]
    map_png_sha256: Mapped[str | None] = mapped_column(ForeignKey("blob.sha256"))
    created_by: Mapped[str]
