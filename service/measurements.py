"""Measurements as they are answered, with their frames and versions."""

from typing import Annotated

from fastapi import Query
from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.methods import get_method
from service.schemas.base import Text
from service.schemas.measured import MeasurementAnswer
from store.queries.calibrations import read_version_statuses
from store.tables import Calibration, FrameRow, Measurement

OfCalibration = Annotated[Text | None, Query(description="Only those made with this version.")]


def answer_measurements(session: Session, rows: list[Measurement]) -> list[MeasurementAnswer]:
    """Measurements with their frames and versions, in a handful of queries however many they are."""
    frame_ids, version_ids = {row.frame_id for row in rows}, {row.calibration_id for row in rows}
    corrected_by = {row.id: get_method(row.method).corrected_by for row in rows}
    corrected = {
        row.id: row.parameters[corrector]
        for row in rows
        if (corrector := corrected_by[row.id]) and corrector in row.parameters
    }
    frames = {f.id: f for f in session.scalars(select(FrameRow).where(FrameRow.id.in_(frame_ids)))}
    wanted = select(Calibration).where(Calibration.id.in_(version_ids))
    versions = {version.id: version for version in session.scalars(wanted)}
    falloff_ids = {named["calibration_id"] for named in corrected.values()}
    status = read_version_statuses(session, sorted({*versions, *falloff_ids}))
    return [
        MeasurementAnswer.of(
            row,
            frames[row.frame_id],
            versions[row.calibration_id],
            status[row.calibration_id],
            status[corrected[row.id]["calibration_id"]] if row.id in corrected else None,
        )
        for row in rows
    ]
