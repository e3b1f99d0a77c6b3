"""Organisations, their keys and usage, what they calibrate and against what."""

from datetime import date, datetime
from typing import Any, ClassVar, Literal

from sqlalchemy import CheckConstraint, ForeignKey, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from store.tables.base import Audited, Base, BigInt, Dated, Identified, Json, Owned, Sha256, one_of

MeterKind = Literal["luminance", "illuminance", "sunshine"]
_WHO = "Who uses the key, as certificates name who fitted and who approved."


class Organisation(Identified, Audited, Dated, Base, prefix="org"):
    name: Mapped[str] = mapped_column(unique=True)
    address: Mapped[str | None]  # as a certificate names it
    operator: Mapped[bool] = mapped_column(default=False)  # it runs this service: its admins found the others
    refuses_incomplete_certificates: Mapped[bool] = mapped_column(default=False)
    """Publishing is refused, not only warned of, while a certificate lacks what ISO/IEC 17025 asks for."""
    time_zone: Mapped[str | None]  # of its cameras' clocks, for files without an offset: IANA name or offset


class ApiKey(Identified, Audited, Dated, Base, prefix="key"):
    """A key of one organisation, known by its hash."""

    __audit_without__: ClassVar[frozenset[str]] = frozenset({"last_used_at"})
    __audit_digests__: ClassVar[frozenset[str]] = frozenset({"sha256"})

    organisation_id: Mapped[str] = mapped_column(ForeignKey("organisation.id"), index=True)
    name: Mapped[str]
    person: Mapped[str | None] = mapped_column(doc=_WHO)
    role: Mapped[str | None] = mapped_column(doc=_WHO)
    sha256: Mapped[Sha256] = mapped_column(unique=True)
    scopes: Mapped[list[str]]
    expires_at: Mapped[datetime | None]
    last_used_at: Mapped[datetime | None] = mapped_column(doc="To ten minutes.")
    revoked_at: Mapped[datetime | None]


class WebSession(Identified, Audited, Dated, Base, prefix="ses"):
    """A browser that signed in with a key. The cookie names it and is signed; nothing here opens it."""

    __audit_without__: ClassVar[frozenset[str]] = frozenset({"last_used_at"})

    organisation_id: Mapped[str] = mapped_column(ForeignKey("organisation.id"), index=True)
    key_id: Mapped[str] = mapped_column(ForeignKey("api_key.id"), index=True)
    browser: Mapped[str | None] = mapped_column(doc="As it names itself.")
    expires_at: Mapped[datetime]
    last_used_at: Mapped[datetime | None] = mapped_column(doc="To ten minutes.")
    ended_at: Mapped[datetime | None]  # signed out, ended by somebody who may, or its key revoked


class Usage(Base):
    """Bytes and rows that an organisation stores, counted as they arrive (store/queries/usage.py)."""

    organisation_id: Mapped[str] = mapped_column(ForeignKey("organisation.id"), primary_key=True)
    frames: Mapped[int]
    stored_bytes: Mapped[BigInt]  # of its frames' files, in each campaign again
    jobs_most: Mapped[int] = mapped_column(default=0)  # no fewer than wait or run: counted only at the quota
    counted_at: Mapped[datetime]  # when it was last counted by adding up


class IdempotentAnswer(Dated, Base):
    """The answer to a request that carried an Idempotency-Key, kept to be given again."""

    organisation_id: Mapped[str] = mapped_column(ForeignKey("organisation.id"), primary_key=True)
    key: Mapped[str] = mapped_column(primary_key=True)
    fingerprint: Mapped[Sha256]  # of method, address and body: the same key for another is refused
    status: Mapped[int]
    headers: Mapped[Json]
    body: Mapped[Json]


class Camera(Identified, Audited, Dated, Owned, Base, prefix="cam"):
    __table_args__ = (
        UniqueConstraint("organisation_id", "make", "model", "serial"),
        CheckConstraint("pixel_pitch_um > 0", "pixel_pitch_positive"),
        CheckConstraint("sensor_width_mm > 0", "sensor_width_positive"),
    )

    make: Mapped[str]
    model: Mapped[str]
    serial: Mapped[str]
    lens_make: Mapped[str | None]
    lens_model: Mapped[str | None]
    lens_serial: Mapped[str | None]
    pixel_pitch_um: Mapped[float | None]
    sensor_width_mm: Mapped[float | None]
    note: Mapped[str | None]


class Meter(Identified, Audited, Dated, Owned, Base, prefix="met"):
    __table_args__ = (
        UniqueConstraint("organisation_id", "kind", "make", "model", "serial"),
        one_of("kind", MeterKind),
        CheckConstraint(
            "certificate_expanded_uncertainty_rel > 0 AND certificate_expanded_uncertainty_rel < 1",
            "certificate_uncertainty_relative",
        ),
        CheckConstraint("certificate_coverage_factor >= 1", "certificate_coverage_factor"),
        CheckConstraint("certificate_due_on >= certificate_issued_on", "certificate_dates"),
    )

    kind: Mapped[str]
    make: Mapped[str]
    model: Mapped[str]
    serial: Mapped[str]
    certificate_number: Mapped[str | None]
    certificate_laboratory: Mapped[str | None]
    certificate_issued_on: Mapped[date | None]
    certificate_due_on: Mapped[date | None]
    certificate_expanded_uncertainty_rel: Mapped[float | None]
    certificate_coverage_factor: Mapped[float | None]


class Panel(Identified, Audited, Dated, Owned, Base, prefix="pnl"):
    """A reflectance panel as measured on a day; measured again, it is another row."""

    __table_args__ = (UniqueConstraint("organisation_id", "serial", "measured_on"),)

    serial: Mapped[str]
    measured_on: Mapped[date]
    bands: Mapped[list[Any]]  # of each its name, reflectance and, where stated, standard uncertainty


class Rig(Identified, Audited, Dated, Owned, Base, prefix="rig"):
    """Cameras that are mounted together; with another camera it is another rig."""

    __table_args__ = (UniqueConstraint("organisation_id", "name"),)

    name: Mapped[str]
    camera_ids: Mapped[list[str]]  # the reference first
