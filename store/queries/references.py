"""What a campaign is measured against: a meter's readings of its scenes, or a panel's reflectances."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.methods import get_method
from radiometry.specification.method import MethodSpec
from store.tables import Campaign, FrameRow, Meter, Panel, Reading

_ENGRAVED = ("kind", "make", "model", "serial")
_CERTIFICATE = ("number", "laboratory", "issued_on", "due_on", "expanded_uncertainty_rel", "coverage_factor")


@dataclass(frozen=True, kw_only=True)
class Reference:
    """``readings``: as the method's fit wants them; ``sources``: by kind, each as engraved and certified."""

    readings: list[Any]
    sources: dict[str, list[dict[str, Any]]]


def find_reference(session: Session, campaign: Campaign, frames: Sequence[FrameRow]) -> Reference:
    """What the campaign's method measures against; most measure against nothing."""
    spec = get_method(campaign.method)
    if spec.reference == "meter":
        meters = _meters(session, campaign)
        return Reference(readings=_read_meters(session, campaign, spec), sources={"meters": meters})
    if spec.reference == "panel":
        panel = find_panel(session, campaign, frames)
        if panel is None:
            return Reference(readings=[], sources={"panels": []})
        return Reference(readings=_read_panel(panel, spec), sources={"panels": [_describe_panel(panel)]})
    return Reference(readings=[], sources={})


def find_panel(session: Session, campaign: Campaign, frames: Sequence[FrameRow]) -> Panel | None:
    """The campaign's panel: the one it names, else the one that its files name, else the only one there is.

    Of a panel that was measured several times, the latest measurement.
    """
    if campaign.panel_id is not None:
        return session.get_one(Panel, campaign.panel_id)
    panels = session.scalars(
        select(Panel)
        .where(Panel.organisation_id == campaign.organisation_id)
        .order_by(Panel.measured_on.desc(), Panel.id.desc())
    ).all()
    named = {serial for frame in frames if (serial := _panel_named_in(frame))}
    matching = [panel for panel in panels if panel.serial in named] if named else list(panels)
    return matching[0] if len({panel.serial for panel in matching}) == 1 else None


def _panel_named_in(frame: FrameRow) -> str | None:
    multispectral = (frame.header or {}).get("multispectral") or {}
    # what the camera recognised, else what the worker read off the panel's code
    serial: str | None = multispectral.get("panel_serial") or (frame.found or {}).get("serial")
    return serial


def _read_panel(panel: Panel, spec: MethodSpec) -> list[Any]:
    return [
        spec.reading(
            panel=panel.serial,
            band=band["band"],
            reflectance=band["reflectance"],
            standard_uncertainty=band.get("standard_uncertainty"),
        )
        for band in sorted(panel.bands, key=lambda band: str(band["band"]))
    ]


def _describe_panel(panel: Panel) -> dict[str, Any]:
    return {"serial": panel.serial, "measured_on": panel.measured_on.isoformat(), "bands": panel.bands}


def _read_meters(session: Session, campaign: Campaign, spec: MethodSpec) -> list[Any]:
    rows = session.execute(
        select(Reading, Meter)
        .outerjoin(Meter, Meter.id == Reading.meter_id)
        .where(Reading.campaign_id == campaign.id, Reading.withdrawn_at.is_(None))
    )
    readings = [
        spec.reading(
            scene=reading.scene,
            quantity=reading.quantity,
            value=reading.value,
            meter=f"{meter.make} {meter.model} {meter.serial}" if meter else None,
            expanded_uncertainty_rel=meter.certificate_expanded_uncertainty_rel if meter else None,
            coverage_factor=meter.certificate_coverage_factor if meter else None,
            taken_at=reading.taken_at.isoformat().replace("+00:00", "Z") if reading.taken_at else None,
        )
        for reading, meter in rows
    ]
    # by content, not by arrival, and here, since databases do not agree on the order of texts: neither the
    # last bit of K nor the content's hash may depend on either
    return sorted(readings, key=lambda r: (r.scene, r.quantity, r.value, r.taken_at or ""))


def _meters(session: Session, campaign: Campaign) -> list[dict[str, Any]]:
    used = select(Reading.meter_id).where(Reading.campaign_id == campaign.id, Reading.withdrawn_at.is_(None))
    rows = session.scalars(select(Meter).where(Meter.id.in_(used)))
    return sorted(map(_describe_meter, rows), key=lambda meter: [meter[name] for name in _ENGRAVED])


def _describe_meter(meter: Meter) -> dict[str, Any]:
    said = {name: getattr(meter, f"certificate_{name}") for name in _CERTIFICATE}
    certificate = {
        name: value.isoformat() if isinstance(value, date) else value
        for name, value in said.items()
        if value is not None
    }
    engraved = {name: getattr(meter, name) for name in _ENGRAVED}
    return {**engraved, **({"certificate": certificate} if certificate else {})}
