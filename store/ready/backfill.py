"""Ready rows of what was published and measured before there were any."""

from sqlalchemy import insert, select
from sqlalchemy.orm import Session

from store.ready.measurements import make_measured
from store.ready.publications import write_ready
from store.tables import Calibration, Camera, FrameRow, MeasuredRow, Measurement, Publication, ReadyRow

_PAGE = 500


def write_missing(session: Session) -> None:
    """Write the rows that are missing, a page at a time; they are derived, so that none is lost."""
    unready = (
        select(Publication)
        .outerjoin(ReadyRow, ReadyRow.publication_id == Publication.id)
        .where(ReadyRow.publication_id.is_(None))
        .order_by(Publication.id)
        .limit(_PAGE)
    )
    last = ""
    while rows := list(session.scalars(unready.where(Publication.id > last))):
        last = rows[-1].id
        write_ready(session, rows)
        session.expunge_all()
    unmeasured = (
        select(Measurement, FrameRow, Calibration, Camera)
        .join(FrameRow, FrameRow.id == Measurement.frame_id)
        .join(Calibration, Calibration.id == Measurement.calibration_id)
        .join(Camera, Camera.id == Calibration.camera_id)
        .outerjoin(MeasuredRow, MeasuredRow.measurement_id == Measurement.id)
        .where(MeasuredRow.measurement_id.is_(None))
        .order_by(Measurement.id)
        .limit(_PAGE)
    )
    last = ""
    while found := session.execute(unmeasured.where(Measurement.id > last)).all():
        last = found[-1][0].id
        session.execute(insert(MeasuredRow), [make_measured(*row) for row in found])
        session.expunge_all()
