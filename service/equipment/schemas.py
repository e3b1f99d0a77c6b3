"""Cameras, meters and panels."""

from typing import Any, Literal

from service.http import models
from service.http.models import Name, maybe, told
from store.queries.evidence import Offer
from store.tables import Camera, Meter, Panel, organisation


def lay_flat(form: models.Form, part: str) -> dict[str, Any]:
    """Return the columns of what a form states; a part of it lies flat in its table."""
    columns, held = form.model_dump(exclude={part}, exclude_none=True), getattr(form, part)
    return columns | {f"{part}_{name}": value for name, value in (held.model_dump() if held else {}).items()}


class Lens(models.Form, models.Answer):
    make: Name = told("Manufacturer of the lens.")
    model: Name = told("As engraved on the lens.")
    serial: Name | None = maybe("As engraved on the lens, where it has one.")


class NewCamera(models.Form):
    make: Name = told("As in the files: DJI.")
    model: Name = told("As in the files: FC6520.")
    serial: Name = told("Of the camera body, as in the files: frames of another body are refused.")
    lens: Lens | None = maybe("The lens it is calibrated with, where it can be changed.")
    pixel_pitch_um: models.PixelPitch | None = maybe(
        "Distance of neighbouring pixels on the sensor; without it, geometry gives no lengths in mm."
    )
    sensor_width_mm: models.Positive | None = maybe("Of the sensitive area.")
    note: models.LongText | None = maybe("Free text, such as where the camera is kept. It changes no result.")


class CameraChange(models.Form):
    """Corrections; what is left out stays."""

    make: Name | None = None
    model: Name | None = None
    serial: Name | None = None
    lens: Lens | None = None
    pixel_pitch_um: models.PixelPitch | None = None
    sensor_width_mm: models.Positive | None = None
    note: models.ClearableLong | None = None


class CameraAnswer(
    models.Answer,
    restates=Camera,
    fields="id make model serial pixel_pitch_um sensor_width_mm note created_at",
):
    lens: Lens | None = None

    @classmethod
    def of(cls, row: Camera) -> "CameraAnswer":
        lens = {name: getattr(row, f"lens_{name}") for name in Lens.model_fields}
        said = {name: value for name, value in lens.items() if value is not None}
        return cls.restate(row, lens=said or None)


class Certificate(models.Form, models.Answer):
    number: models.Text = told(
        "As the certificate states it. Without a certificate, u(K) does not include the "
        "calibration of the meter, and K is flagged."
    )
    laboratory: models.Text = told("Who issued the certificate.")
    issued_on: models.Day = told("Date of the certificate.")
    due_on: models.Day = told(
        "When the meter is to be calibrated again; certificates name later readings as a gap. Not before "
        "`issued_on`."
    )
    expanded_uncertainty_rel: models.Number = told(
        "U of the reading, relative to it, as the certificate states it.", gt=0, lt=1
    )
    coverage_factor: models.Number = told("k of the expanded uncertainty U = k u; usually 2.", ge=1, le=10)

    def check(self) -> None:
        if self.due_on < self.issued_on:
            raise ValueError("due_on lies before issued_on")


class NewMeter(models.Form):
    kind: organisation.MeterKind = told(
        "What it measures: cd/m², lx, or the irradiance beside a multispectral camera."
    )
    make: Name = told("Manufacturer of the meter.")
    model: Name = told("As on its type plate.")
    serial: Name = told("As on its type plate: the certificate holds for this meter alone.")
    certificate: Certificate | None = maybe("The calibration certificate that is in force for the readings.")


class MeterAnswer(models.Answer, restates=Meter, fields="id kind make model serial created_at"):
    certificate: Certificate | None = None

    @classmethod
    def of(cls, row: Meter) -> "MeterAnswer":
        certificate = {name: getattr(row, f"certificate_{name}") for name in Certificate.model_fields}
        return cls.restate(row, certificate=certificate if row.certificate_number is not None else None)


class PanelBand(models.Form, models.Answer):
    """Reflectance of a panel in a band; `Red edge`, `RedEdge`, `red_edge` are one name, always the last."""

    band: models.BandName
    reflectance: models.Number = told("A share; over 1 only for a glossy panel.", gt=0, le=1.2)
    standard_uncertainty: models.Number | None = maybe("Absolute, as the reflectance is; k = 1.", ge=0, lt=1)
    origin: Literal["file"] | None = maybe(
        "`file`: as the camera or the panel's code states it, on a day that is not known."
    )


class NewPanel(models.Form):
    serial: Name = told("As printed on the panel, or in its code.")
    measured_on: models.Day = told("When its reflectance was measured: panels age.")
    bands: list[PanelBand] = told(
        "Each band once.", min_length=1, max_length=100, json_schema_extra=models.EACH_ONCE
    )

    def check(self) -> None:
        names = [band.band for band in self.bands]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"each band once; given more than once: {', '.join(twice)}")

    def columns(self) -> dict[str, Any]:
        """The table's columns; the bands in an order that does not depend on how they were sent."""
        bands = sorted((band.model_dump(exclude_none=True) for band in self.bands), key=lambda b: b["band"])
        return {"serial": self.serial, "measured_on": self.measured_on, "bands": bands}


class PanelOffered(models.Answer, restates=Offer, fields="serial registered"):
    """The panel that a campaign's frames name, where it is not the campaign's."""

    bands: list[PanelBand] = told("As the files or the panel's code state them; may be empty.")


class PanelAnswer(models.Answer, restates=Panel, fields="id serial measured_on created_at"):
    bands: list[PanelBand]
