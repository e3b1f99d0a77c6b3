"""Calibration versions, which never change, and what was published of them from when to when."""

from datetime import datetime

from sqlalchemy import CheckConstraint, ForeignKey, Index, String, UniqueConstraint, text
from sqlalchemy.orm import Mapped, mapped_column

from store.columns import UtcDateTime, new_id, utc_now
from store.tables.base import Audited, AuditedTogether, Base, Json


class Calibration(Audited, Base):
    """One version, complete and immutable (triggers hold it). Its state follows from publications.

    Attributes
    ----------
    software : dict
        The fit code version (`stilb`), the release (`release`) and the packages that fitted.
    """

    __tablename__ = "calibration"
    __table_args__ = (
        UniqueConstraint("camera_id", "method", "version"),
        UniqueConstraint("campaign_id", "content_sha256"),
        CheckConstraint("version >= 1", "version_counts_from_1"),
    )
    __audit_digests__ = frozenset({"result", "inputs"})

    id: Mapped[str] = mapped_column(primary_key=True, default=lambda: new_id("cal"))
    organisation_id: Mapped[str] = mapped_column(ForeignKey("organisation.id"), index=True)
    camera_id: Mapped[str] = mapped_column(ForeignKey("camera.id"))
    campaign_id: Mapped[str] = mapped_column(ForeignKey("campaign.id"))
    method: Mapped[str] = mapped_column(String)
    version: Mapped[int]
    configuration: Mapped[Json]
    parameters: Mapped[Json]
    inputs: Mapped[Json]
    result: Mapped[Json]
    result_schema: Mapped[int]
    software: Mapped[Json]
    content_sha256: Mapped[str] = mapped_column(String(64))
    """Over inputs, parameters and code version: the same content is the same version."""
    created_by: Mapped[str]
    created_at: Mapped[datetime] = mapped_column(UtcDateTime, default=utc_now)


class CoefficientRow(AuditedTogether, Base):
    __tablename__ = "coefficient"
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


class Slot(Base):
    """A camera's method in one configuration, which at most one published version may hold at any time."""

    __tablename__ = "slot"
    __table_args__ = (UniqueConstraint("camera_id", "method", "configuration"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    camera_id: Mapped[str] = mapped_column(ForeignKey("camera.id"))
    method: Mapped[str]
    configuration: Mapped[str]


class Publication(Audited, Base):
    """A version in force in [valid_from, valid_to), as known in [known_from, known_to): bitemporal.

    A row is only ever closed (known_to is set); a changed validity is a new row. That no two rows of a slot
    overlap in both times is held by the database.
    """

    __tablename__ = "publication"
    __table_args__ = (
        CheckConstraint("valid_to IS NULL OR valid_from < valid_to", "validity_not_empty"),
        CheckConstraint("known_to IS NULL OR known_from <= known_to", "knowledge_ordered"),
        Index("ix_publication_slot_id", "slot_id"),
        Index("ix_publication_calibration_id", "calibration_id"),
        Index(
            "ix_publication_in_force",
            "calibration_id",
            sqlite_where=text("known_to IS NULL AND superseded_by IS NULL"),
            postgresql_where=text("known_to IS NULL AND superseded_by IS NULL"),
        ),
    )

    id: Mapped[str] = mapped_column(primary_key=True, default=lambda: new_id("pub"))
    slot_id: Mapped[int] = mapped_column(ForeignKey("slot.id"))
    calibration_id: Mapped[str] = mapped_column(ForeignKey("calibration.id"))
    valid_from: Mapped[datetime] = mapped_column(UtcDateTime)
    valid_to: Mapped[datetime | None] = mapped_column(UtcDateTime)
    known_from: Mapped[datetime] = mapped_column(UtcDateTime)
    known_to: Mapped[datetime | None] = mapped_column(UtcDateTime)
    reason: Mapped[str]
    superseded_by: Mapped[str | None] = mapped_column(ForeignKey("calibration.id"))
    """Whose publication closed this row, where one did."""


class Revocation(Audited, Base):
    __tablename__ = "revocation"

    calibration_id: Mapped[str] = mapped_column(ForeignKey("calibration.id"), primary_key=True)
    reason: Mapped[str]
    revoked_by: Mapped[str]
    revoked_at: Mapped[datetime] = mapped_column(UtcDateTime, default=utc_now)


class IssuedCertificate(Audited, Base):
    """A certificate as it was issued when a version was published (triggers hold it).

    Attributes
    ----------
    amendment : int
        0 of the original; each later publication of the version issues the next one beside it.
    at_upgrade : bool
        Whether the version was published before certificates were kept: its certificate was issued later.
    """

    __tablename__ = "issued_certificate"

    calibration_id: Mapped[str] = mapped_column(ForeignKey("calibration.id"), primary_key=True)
    amendment: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    number: Mapped[str]
    publication_id: Mapped[str] = mapped_column(ForeignKey("publication.id"))
    json_sha256: Mapped[str] = mapped_column(ForeignKey("blob.sha256"))
    pdf_sha256: Mapped[str] = mapped_column(ForeignKey("blob.sha256"))
    fitted_by: Mapped[Json | None]
    """Name and role; None of a key without a person."""
    approved_by: Mapped[Json | None]
    """Likewise; nobody has signed a certificate without."""
    at_upgrade: Mapped[bool]
    issued_at: Mapped[datetime] = mapped_column(UtcDateTime)
