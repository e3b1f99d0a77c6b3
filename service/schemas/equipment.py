"""Cameras and meters."""

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, model_validator

from service.schemas.base import Answer, Day, Form, Instant, LongText, Number, PixelPitch, Positive, Text
from store.tables import Camera, Meter


class Lens(Form, Answer):
    make: Text
    model: Text
    serial: Text | None = None


class NewCamera(Form):
    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "make": "DJI",
                    "model": "FC6520",
                    "serial": "0K1XE8",
                    "lens": {"make": "DJI", "model": "MFT 15mm F1.7 ASPH"},
                    "pixel_pitch_um": 3.28,
                }
            ]
        }
    )

    make: Text
    model: Text
    serial: Text
    lens: Lens | None = None
    pixel_pitch_um: PixelPitch | None = None
    sensor_width_mm: Positive | None = None
    note: LongText | None = None


class CameraAnswer(Answer):
    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "id": "cam_1",
                    "make": "DJI",
                    "model": "FC6520",
                    "serial": "0K1XE8",
                    "created_at": "2026-05-01T08:00:00Z",
                }
            ]
        }
    )

    id: str
    make: str
    model: str
    serial: str
    lens: Lens | None = None
    pixel_pitch_um: float | None = None
    sensor_width_mm: float | None = None
    note: str | None = None
    created_at: Instant

    @classmethod
    def of(cls, row: Camera) -> "CameraAnswer":
        said = {name: getattr(row, f"lens_{name}") for name in Lens.model_fields}
        lens = {name: value for name, value in said.items() if value is not None}
        return cls(
            id=row.id,
            make=row.make,
            model=row.model,
            serial=row.serial,
            lens=Lens.model_validate(lens) if lens else None,
            pixel_pitch_um=row.pixel_pitch_um,
            sensor_width_mm=row.sensor_width_mm,
            note=row.note,
            created_at=row.created_at,
        )


class Certificate(Form, Answer):
    number: Text
    laboratory: Text
    issued_on: Day
    due_on: Day
    expanded_uncertainty_rel: Annotated[Number, Field(gt=0, lt=1)]
    coverage_factor: Annotated[Number, Field(ge=1, le=10)]

    @model_validator(mode="after")
    def _dates_in_order(self) -> "Certificate":
        if self.due_on < self.issued_on:
            raise ValueError("due_on lies before issued_on")
        return self


class NewMeter(Form):
    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "kind": "luminance",
                    "make": "Gossen",
                    "model": "Starlite 2",
                    "serial": "8F0042",
                    "certificate": {
                        "number": "D-K-15070-2026-04",
                        "laboratory": "PTB",
                        "issued_on": "2026-04-02",
                        "due_on": "2027-04-02",
                        "expanded_uncertainty_rel": 0.02,
                        "coverage_factor": 2,
                    },
                }
            ]
        }
    )

    kind: Literal["luminance", "illuminance", "sunshine"]
    make: Text
    model: Text
    serial: Text
    certificate: Certificate | None = None

    def columns(self) -> dict[str, Any]:
        """The table's columns: the certificate lies flat in it."""
        certificate = self.certificate.model_dump() if self.certificate else {}
        return {
            **self.model_dump(exclude={"certificate"}),
            **{f"certificate_{name}": value for name, value in certificate.items()},
        }


class MeterAnswer(Answer):
    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "id": "met_1",
                    "kind": "luminance",
                    "make": "Gossen",
                    "model": "Starlite 2",
                    "serial": "8F0042",
                    "created_at": "2026-05-01T08:00:00Z",
                }
            ]
        }
    )

    id: str
    kind: str
    make: str
    model: str
    serial: str
    certificate: Certificate | None = None
    created_at: Instant

    @classmethod
    def of(cls, row: Meter) -> "MeterAnswer":
        certificate = None
        if row.certificate_number is not None:
            certificate = Certificate.model_validate(
                {name: getattr(row, f"certificate_{name}") for name in Certificate.model_fields}
            )
        return cls(
            id=row.id,
            kind=row.kind,
            make=row.make,
            model=row.model,
            serial=row.serial,
            certificate=certificate,
            created_at=row.created_at,
        )
