"""Record of a measurement: everything that its recomputing needs but the frames themselves."""

from typing import Any

from pydantic import Field

from service.schemas.base import Answer
from store.tables import Calibration, FrameRow, Measurement

RECORD_SCHEMA = 1


class MeasuredFrame(Answer, restates=(FrameRow,), fields="id filename sha256 role supplied exposure"):
    """A frame of the measurement: its file by hash, and its exposure as it was used."""


class MeasuredWith(
    Answer, restates=(Calibration,), fields="id method version content_sha256 parameters inputs result"
):
    """The calibration version, as stored."""


class MeasurementRecord(
    Answer, restates=(Measurement,), fields="id method parameters result software content_sha256"
):
    """A measurement as stored, with its frames and calibration version: `make verify` recomputes it."""

    schema_version: int
    frames: list[MeasuredFrame] = Field(description="The measured frame first.")
    calibration: MeasuredWith
    map_sha256: str | None = Field(default=None, description="SHA-256 of map.tif, where there is one.")

    @classmethod
    def of(cls, row: Measurement, frames: list[FrameRow], calibration: Calibration) -> "MeasurementRecord":
        more: dict[str, Any] = {
            "schema_version": RECORD_SCHEMA,
            "frames": [MeasuredFrame.restate(frame) for frame in frames],
            "calibration": MeasuredWith.restate(calibration),
            "map_sha256": row.map_tif_sha256,
        }
        return cls.restate(row, **more)
