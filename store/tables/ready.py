"""Rows derived from others when those are written, so that who reads a long list computes nothing.

Not audited: each can be written again from the rows that it is derived from (store/ready).
"""

from datetime import datetime

from sqlalchemy import ForeignKey, Index, text
from sqlalchemy.orm import Mapped, mapped_column

from store.columns import UtcDateTime
from store.tables.base import Base

_KNOWN_NOW = text("known_to IS NULL")


class ReadyRow(Base):
    """A publication with what a look-up and a series ask it for, one row for each."""

    __tablename__ = "ready"
    __table_args__ = (
        Index("ix_ready_slot_id_valid_from", "slot_id", "valid_from"),
        Index(
            "ix_ready_slot_id_now",
            "slot_id",
            "valid_from",
            sqlite_where=_KNOWN_NOW,
            postgresql_where=_KNOWN_NOW,
        ),
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
    computed_at: Mapped[datetime] = mapped_column(UtcDateTime)
    valid_from: Mapped[datetime] = mapped_column(UtcDateTime)
    valid_to: Mapped[datetime | None] = mapped_column(UtcDateTime)
    known_from: Mapped[datetime] = mapped_column(UtcDateTime)
    known_to: Mapped[datetime | None] = mapped_column(UtcDateTime)
    coefficients: Mapped[int]
    """How many coefficients the version has."""


class ReadyAnswer(Base):
    """The coefficients of a publication as they are answered.

    Attributes
    ----------
    items : bytes
        JSON list of all of them, in their order.
    whole : bool
        A look-up without a filter is answered with all of them: none is a general one's at an f-number.
    foreseen : str or None
        JSON object: the standard uncertainty at an f-number that was not calibrated, by position in `items`.
    """

    __tablename__ = "ready_answer"

    publication_id: Mapped[str] = mapped_column(ForeignKey("ready.publication_id"), primary_key=True)
    etag: Mapped[str]
    whole: Mapped[bool]
    foreseen: Mapped[str | None]
    items: Mapped[bytes]


class ReadyCells(Base):
    """The coefficients of a publication as rows of a series: CSV records, a line each, in their order.

    The camera and its names are left out: a series has the names of today.
    """

    __tablename__ = "ready_cells"

    publication_id: Mapped[str] = mapped_column(ForeignKey("ready.publication_id"), primary_key=True)
    cells: Mapped[str]


class MeasuredRow(Base):
    """A measurement as one row of a series.

    Attributes
    ----------
    taken_from : datetime
        Earliest instant at which the frame may have been taken; of a frame without a time, `created_at`.
    taken_to : datetime or None
        Latest such instant, `taken_from` if the file states a time zone; None for a frame without a time.
    cells : str
        The static cells, a CSV record.
    """

    __tablename__ = "measured"
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
    corrector_id: Mapped[str | None]
    """Version that corrected the frame's vignetting, where one did."""
    taken_from: Mapped[datetime] = mapped_column(UtcDateTime)
    taken_to: Mapped[datetime | None] = mapped_column(UtcDateTime)
    created_at: Mapped[datetime] = mapped_column(UtcDateTime)
    cells: Mapped[str]
