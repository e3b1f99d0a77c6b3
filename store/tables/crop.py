"""Parts of frames as pictures of their very pixels, kept while they are the newest of their organisation."""

from datetime import datetime

from sqlalchemy import ForeignKey, Index
from sqlalchemy.orm import Mapped, mapped_column

from store.columns import UtcDateTime, new_id, utc_now
from store.tables.base import Base


class Crop(Base):
    """A picture that can be drawn again from its frame; derived, so never audited.

    Attributes
    ----------
    asked : str
        What was asked for: window, and range of the grey scale.
    job_id : str
        The job that drew it; its result tells the rest.
    png : bytes
        The picture.
    """

    __tablename__ = "crop"
    __table_args__ = (
        Index("ix_crop_frame_id_asked", "frame_id", "asked"),
        Index("ix_crop_organisation_id_id", "organisation_id", "id"),
    )

    id: Mapped[str] = mapped_column(primary_key=True, default=lambda: new_id("crp"))
    organisation_id: Mapped[str] = mapped_column(ForeignKey("organisation.id"))
    frame_id: Mapped[str] = mapped_column(ForeignKey("frame.id"))
    asked: Mapped[str]
    job_id: Mapped[str] = mapped_column(ForeignKey("job.id"))
    png: Mapped[bytes]
    created_at: Mapped[datetime] = mapped_column(UtcDateTime, default=utc_now)
