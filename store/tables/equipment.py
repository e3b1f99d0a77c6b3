"""Tables of what is calibrated and what it is calibrated against."""

from datetime import date, datetime
from typing import Any

from sqlalchemy import CheckConstraint, ForeignKey, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from store.columns import UtcDateTime, new_id, utc_now
from store.tables.base import Audited, Base


class Camera(Audited, Base):
    __tablename__ = "camera"
    __table_args__ = (
        UniqueConstraint("organisation_id", "make", "model", "serial"),
        CheckConstraint("pixel_pitch_um > 0", "pixel_pitch_positive"),
        CheckConstraint("sensor_width_mm > 0", "sensor_width_positive"),
    )

    id: Mapped[str] = mapped_column(primary_key=True, default=lambda: new_id("cam"))
    organisation_id: Mapped[str] = mapped_column(ForeignKey("organisation.id"))
    make: Mapped[str]
    model: Mapped[str]
    serial: Mapped[str]
    lens_make: Mapped[str | None]
    lens_model: Mapped[str | None]
    lens_serial: Mapped[str | None]
    pixel_pitch_um: Mapped[float | None]
    sensor_width_mm: Mapped[float | None]
    note: Mapped[str | None]
    created_at: Mapped[datetime] = mapped_column(UtcDateTime, default=utc_now)


class Meter(Audited, Base):
    __tablename__ = "meter"
    __table_args__ = (
        UniqueConstraint("organisation_id", "kind", "make", "model", "serial"),
        CheckConstraint("kind IN ('luminance', 'illuminance', 'sunshine')", "kind_known"),
        CheckConstraint(
            "certificate_expanded_uncertainty_rel > 0 AND certificate_expanded_uncertainty_rel < 1",
            "certificate_uncertainty_relative",
        ),
        CheckConstraint("certificate_coverage_factor >= 1", "certificate_coverage_factor"),
        CheckConstraint("certificate_due_on >= certificate_issued_on", "certificate_dates"),
    )

    id: Mapped[str] = mapped_column(primary_key=True, default=lambda: new_id("met"))
    organisation_id: Mapped[str] = mapped_column(ForeignKey("organisation.id"))
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
    created_at: Mapped[datetime] = mapped_column(UtcDateTime, default=utc_now)


class Panel(Audited, Base):
    """A reflectance panel as measured on a day; measured again, it is another row (triggers hold it)."""

    __tablename__ = "panel"
    __table_args__ = (UniqueConstraint("organisation_id", "serial", "measured_on"),)

    id: Mapped[str] = mapped_column(primary_key=True, default=lambda: new_id("pnl"))
    organisation_id: Mapped[str] = mapped_column(ForeignKey("organisation.id"))
    serial: Mapped[str]
    measured_on: Mapped[date]
    bands: Mapped[list[Any]]
    """Of each band its name, its reflectance and, where stated, the standard uncertainty of that."""
    created_at: Mapped[datetime] = mapped_column(UtcDateTime, default=utc_now)


class Rig(Audited, Base):
    """Cameras that are mounted together; with another camera it is another rig."""

    __tablename__ = "rig"
    __table_args__ = (UniqueConstraint("organisation_id", "name"),)

    id: Mapped[str] = mapped_column(primary_key=True, default=lambda: new_id("rig"))
    organisation_id: Mapped[str] = mapped_column(ForeignKey("organisation.id"))
    name: Mapped[str]
    camera_ids: Mapped[list[str]]
    """The reference first."""
    created_at: Mapped[datetime] = mapped_column(UtcDateTime, default=utc_now)
