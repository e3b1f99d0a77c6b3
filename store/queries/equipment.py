"""Cameras, meters and panels, each found by what is engraved on it."""

from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from store.tables import Camera, Meter, Panel

_SENSOR = ("pixel_pitch_um", "sensor_width_mm")


def find_or_add_camera(session: Session, organisation_id: str, values: dict[str, Any]) -> tuple[Camera, bool]:
    """The camera of this make, model and serial, and whether it is new.

    What nobody had said of its sensor is taken over; what is known stays as it is.
    """
    found = session.scalar(
        select(Camera).where(
            Camera.organisation_id == organisation_id,
            Camera.make == values["make"],
            Camera.model == values["model"],
            Camera.serial == values["serial"],
        )
    )
    if found is not None:
        for name in _SENSOR:
            if getattr(found, name) is None:
                setattr(found, name, values.get(name))
        session.flush()
        return found, False
    camera = Camera(organisation_id=organisation_id, **values)
    session.add(camera)
    session.flush()
    return camera, True


def find_or_add_meter(session: Session, organisation_id: str, values: dict[str, Any]) -> tuple[Meter, bool]:
    """The meter of this kind, make, model and serial, and whether it is new; a certificate is taken over."""
    found = session.scalar(
        select(Meter).where(
            Meter.organisation_id == organisation_id,
            Meter.kind == values["kind"],
            Meter.make == values["make"],
            Meter.model == values["model"],
            Meter.serial == values["serial"],
        )
    )
    if found is None:
        found = Meter(organisation_id=organisation_id, **values)
        session.add(found)
        session.flush()
        return found, True
    for name, value in values.items():
        if name.startswith("certificate_"):
            setattr(found, name, value)
    session.flush()
    return found, False


def find_or_add_panel(session: Session, organisation_id: str, values: dict[str, Any]) -> tuple[Panel, bool]:
    """The panel of this serial as measured on this day, and whether it is new; its figures never change."""
    found = session.scalar(
        select(Panel).where(
            Panel.organisation_id == organisation_id,
            Panel.serial == values["serial"],
            Panel.measured_on == values["measured_on"],
        )
    )
    if found is not None:
        return found, False
    panel = Panel(organisation_id=organisation_id, **values)
    session.add(panel)
    session.flush()
    return panel, True
