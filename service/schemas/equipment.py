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
    make: Text = Field(description="Manufacturer of the lens.")
    model: Text = Field(description="As engraved on the lens.")
    serial: Text | None = Field(default=None, description="As engraved on the lens, where it has one.")


class NewCamera(Form):
    make: Text = Field(description="As in the files: DJI.")
    model: Text = Field(description="As in the files: FC6520.")
    serial: Text = Field(
        description="Of the camera body, as in the files: frames of another body are refused."
    )
    lens: Lens | None = Field(
        default=None, description="The lens it is calibrated with, where it can be changed."
    )
    pixel_pitch_um: PixelPitch | None = Field(
        default=None,
        description="Distance of neighbouring pixels on the sensor; without it, geometry gives no "
        "lengths in mm.",
    )
    sensor_width_mm: Positive | None = Field(default=None, description="Of the sensitive area.")
    note: LongText | None = Field(
        default=None, description="Free text, such as where the camera is kept. It changes no result."
    )


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
    number: Text = Field(
        description="As the certificate states it. Without a certificate, u(K) does not include the "
        "calibration of the meter, and K is flagged."
    )
    laboratory: Text = Field(description="Who issued the certificate.")
    issued_on: Day = Field(description="Date of the certificate.")
    due_on: Annotated[
        Day,
        Field(
            description="When the meter is to be calibrated again; certificates name later readings "
            "as a gap."
            "Not before `issued_on`."
        ),
    ]
    expanded_uncertainty_rel: Annotated[
        Number,
        Field(gt=0, lt=1, description="U of the reading, relative to it, as the certificate states it."),
    ]
    coverage_factor: Annotated[
        Number, Field(ge=1, le=10, description="k of the expanded uncertainty U = k u; usually 2.")
    ]

    @model_validator(mode="after")
    def _dates_in_order(self) -> "Certificate":
        if self.due_on < self.issued_on:
            raise ValueError("due_on lies before issued_on")
        return self


class NewMeter(Form):
    kind: Literal["luminance", "illuminance", "sunshine"] = Field(
        description="What it measures: cd/m², lx, or the irradiance beside a multispectral camera."
    )
    make: Text = Field(description="Manufacturer of the meter.")
    model: Text = Field(description="As on its type plate.")
    serial: Text = Field(description="As on its type plate: the certificate holds for this meter alone.")
    certificate: Certificate | None = Field(
        default=None, description="The calibration certificate that is in force for the readings."
    )

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
