"""Cameras and meters."""

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from service.schemas.base import (
    Answer,
    ClearableLong,
    Day,
    Form,
    LongText,
    Number,
    PixelPitch,
    Positive,
    Text,
)
from store.tables import Camera, Meter


class Lens(Form, Answer):
    make: Text
    model: Text
    serial: Text | None = None


class NewCamera(Form):
    make: Text
    model: Text
    serial: Text
    lens: Lens | None = None
    pixel_pitch_um: PixelPitch | None = None
    sensor_width_mm: Positive | None = None
    note: LongText | None = None


class CameraChange(Form):
    """Corrections; what is left out stays."""

    make: Text | None = None
    model: Text | None = None
    serial: Text | None = None
    lens: Lens | None = None
    pixel_pitch_um: PixelPitch | None = None
    sensor_width_mm: Positive | None = None
    note: ClearableLong | None = None


class CameraAnswer(
    Answer, restates=Camera, fields="id make model serial pixel_pitch_um sensor_width_mm note created_at"
):
    lens: Lens | None = None

    @classmethod
    def of(cls, row: Camera) -> "CameraAnswer":
        lens = {name: getattr(row, f"lens_{name}") for name in Lens.model_fields}
        said = {name: value for name, value in lens.items() if value is not None}
        return cls.restate(row, lens=said or None)


class Certificate(Form, Answer):
    number: Text
    laboratory: Text
    issued_on: Day
    due_on: Annotated[Day, Field(description="Not before `issued_on`.")]
    expanded_uncertainty_rel: Annotated[Number, Field(gt=0, lt=1)]
    coverage_factor: Annotated[Number, Field(ge=1, le=10)]

    @model_validator(mode="after")
    def _dates_in_order(self) -> "Certificate":
        if self.due_on < self.issued_on:
            raise ValueError("due_on lies before issued_on")
        return self


class NewMeter(Form):
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


class MeterAnswer(Answer, restates=Meter, fields="id kind make model serial created_at"):
    certificate: Certificate | None = None

    @classmethod
    def of(cls, row: Meter) -> "MeterAnswer":
        certificate = {name: getattr(row, f"certificate_{name}") for name in Certificate.model_fields}
        return cls.restate(row, certificate=certificate if row.certificate_number is not None else None)
