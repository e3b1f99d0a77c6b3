"""References of a campaign: a meter's readings of its scenes, or a panel's reflectances."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.frame.bands import name_panel
from radiometry.methods import get_method
from radiometry.specification.method import MethodSpec
from store.columns import utc_now
from store.queries.frame_columns import FrameColumns, read_frames
from store.tables import Campaign, Meter, Panel, Reading

_ENGRAVED = ("kind", "make", "model", "serial")
_CERTIFICATE = ("number", "laboratory", "issued_on", "due_on", "expanded_uncertainty_rel", "coverage_factor")


@dataclass(frozen=True, kw_only=True)
class Reference:
    """``readings``: as the method's fit wants them; ``sources``: by kind, each as engraved and certified."""

    readings: list[Any]
    sources: dict[str, list[dict[str, Any]]]


def find_reference(session: Session, campaign: Campaign, frames: Sequence[FrameColumns]) -> Reference:
    """Return what the campaign's method measures against; most measure against nothing."""
    spec = get_method(campaign.method)
    if spec.reference == "meter":
        meters = _meters(session, campaign)
        return Reference(readings=_read_meters(session, campaign, spec), sources={"meters": meters})
    if spec.reference == "panel":
        measured = list_measurements(session, campaign, frames)
        return Reference(
            readings=[reading for panel in measured for reading in _read_panel(panel, spec)],
            sources={"panels": [_describe_panel(panel) for panel in measured]},
        )
    return Reference(readings=[], sources={})


def list_measurements(session: Session, campaign: Campaign, frames: Sequence[FrameColumns]) -> list[Panel]:
    """Every measurement of the campaign's panel, oldest first; none where it is not known.

    The panel is the one that the campaign names, else the one that its files name, else the only one.
    """
    panels = session.scalars(
        select(Panel)
        .where(Panel.organisation_id == campaign.organisation_id)
        .order_by(Panel.measured_on, Panel.id)
    ).all()
    if campaign.panel_id is not None:
        named = {session.get_one(Panel, campaign.panel_id).serial}
    else:
        said = {serial for frame in frames for serial in list_panels(frame)}
        named = said or {each.serial for each in panels}
    names = {*map(name_panel, named)}
    found = [panel for panel in panels if name_panel(panel.serial) in names]
    return found if len({name_panel(panel.serial) for panel in found}) == 1 else []


def list_panels(frame: FrameColumns) -> list[str]:
    """The panels that a frame names: as the worker read its code, and as the camera recognised it."""
    band = frame.header.multispectral if frame.header else None
    stated = (frame.found.get("serial"), band.panel_serial if band else None)
    return [serial for serial in stated if serial]


@dataclass(frozen=True, kw_only=True)
class Offer:
    """The panel that a campaign's frames name, where it is not the campaign's.

    ``bands``: as the files or the code state them; ``stated_on``: the day of the first of these frames.
    """

    serial: str
    registered: bool
    bands: list[dict[str, Any]]
    stated_on: date


def find_offer(session: Session, campaign: Campaign) -> Offer | None:
    """The one panel that the frames name; None where that is the campaign's, or there are none or several."""
    spec = get_method(campaign.method)
    if spec.reference != "panel":
        return None
    frames = sorted(read_frames(session, campaign, spec.role_names), key=lambda each: each.filename)
    shown = [(frame, frame.header) for frame in frames if frame.header is not None and list_panels(frame)]
    names = {name_panel(serial) for frame, _ in shown for serial in list_panels(frame)}
    if len(names) != 1:
        return None
    if names == {name_panel(panel.serial) for panel in list_measurements(session, campaign, frames)}:
        return None
    bands: dict[str, dict[str, Any]] = {}
    for frame, header in shown:
        band = header.multispectral
        albedo = (band.panel_albedo if band else None) or frame.found.get("albedo")
        if band and albedo and 0.0 < albedo <= 1.0:
            bands.setdefault(band.band, {"band": band.band, "reflectance": albedo, "origin": "file"})
    days = [header.taken_at[:10] for _, header in shown if header.taken_at]
    (serial,) = names
    return Offer(
        serial=serial,
        registered=find_by_serial(session, campaign.organisation_id, serial) is not None,
        bands=[bands[name] for name in sorted(bands)],
        stated_on=date.fromisoformat(min(days)) if days else utc_now().date(),
    )


def find_by_serial(session: Session, organisation_id: str, serial: str) -> Panel | None:
    """The last measurement of a registered panel; its serial number may be written in any way."""
    panels = session.scalars(
        select(Panel).where(Panel.organisation_id == organisation_id).order_by(Panel.measured_on.desc())
    )
    return next((panel for panel in panels if name_panel(panel.serial) == name_panel(serial)), None)


def _read_panel(panel: Panel, spec: MethodSpec) -> list[Any]:
    return [
        spec.reading(
            panel=panel.serial,
            band=band["band"],
            reflectance=band["reflectance"],
            standard_uncertainty=band.get("standard_uncertainty"),
            measured_on=panel.measured_on.isoformat(),
            from_file=True if band.get("origin") == "file" else None,
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
