"""Everything a campaign has to offer to a fit, as the science wants it: frames, readings, references."""

from collections import Counter, defaultdict
from collections.abc import Collection, Sequence
from dataclasses import replace
from datetime import date
from functools import partial
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry import methods, records
from radiometry.findings import shared
from radiometry.findings.grouping import Cause
from radiometry.fitting.evidence import Exclusion, FrameEvidence
from radiometry.frame import FrameHeader
from radiometry.frame.multispectral import name_panel
from radiometry.methods import get_method
from radiometry.specification.method import MethodSpec
from store.queries.frame_times import Zones, find_offset, read_zones
from store.queries.frames import (
    ExtractionColumns,
    FrameColumns,
    Memory,
    list_outdated,
    read_extractions,
    read_frames,
    region_ids,
)
from store.tables import Campaign, Meter, Panel, Reading, utc_now

_ENGRAVED = ("kind", "make", "model", "serial")
_CERTIFICATE = ("number", "laboratory", "issued_on", "due_on", "expanded_uncertainty_rel", "coverage_factor")


def find_reference(
    session: Session, campaign: Campaign, spec: MethodSpec, frames: Sequence[FrameColumns]
) -> tuple[list[Any], dict[str, list[dict[str, Any]]]]:
    """Return the readings as the method's fit wants them, and by kind what they were made with."""
    if spec.reference == "meter":
        return _read_meters(session, campaign, spec), {"meters": _meters(session, campaign)}
    if spec.reference == "panel":
        measured = list_measurements(session, campaign, frames)
        described = [
            {"serial": each.serial, "measured_on": each.measured_on.isoformat(), "bands": each.bands}
            for each in measured
        ]
        return [reading for each in measured for reading in _read_panel(each, spec)], {"panels": described}
    return [], {}


def list_measurements(session: Session, campaign: Campaign, frames: Sequence[FrameColumns]) -> list[Panel]:
    """Every measurement of the campaign's panel, oldest first; none where it is not known."""
    mine = select(Panel).where(Panel.organisation_id == campaign.organisation_id)
    panels = session.scalars(mine.order_by(Panel.measured_on, Panel.id)).all()
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


class Offer(records.Record):
    """The panel that a campaign's frames name, where it is not the campaign's."""

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
    mine = select(Panel).where(Panel.organisation_id == organisation_id)
    panels = session.scalars(mine.order_by(Panel.measured_on.desc()))
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


def _read_meters(session: Session, campaign: Campaign, spec: MethodSpec) -> list[Any]:
    both = select(Reading, Meter).outerjoin(Meter, Meter.id == Reading.meter_id)
    rows = session.execute(both.where(Reading.standing(campaign.id)))
    readings = [
        spec.reading(
            scene=reading.scene,
            quantity=reading.quantity,
            value=reading.value,
            meter=f"{meter.make} {meter.model} {meter.serial}" if meter else None,
            expanded_uncertainty_rel=meter.certificate_expanded_uncertainty_rel if meter else None,
            coverage_factor=meter.certificate_coverage_factor if meter else None,
            taken_at=reading.taken_at.isoformat().replace("+00:00", "Z") if reading.taken_at else None,
            reason=reading.reason,
        )
        for reading, meter in rows
    ]
    # by content, not by arrival, and here, since databases do not agree on the order of texts: neither the
    # last bit of K nor the content's hash may depend on either
    return sorted(readings, key=lambda r: (r.scene, r.quantity, r.value, r.taken_at or ""))


def _meters(session: Session, campaign: Campaign) -> list[dict[str, Any]]:
    used = select(Reading.meter_id).where(Reading.standing(campaign.id))
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


class Evidence(records.Record):
    """Rows for the fit. ``names``: frame id to the fit's name of it; the others: by that name."""

    frames: list[Any]
    readings: list[Any]
    names: dict[str, str]
    hashes: dict[str, str]
    headers: dict[str, FrameHeader]
    offsets: dict[str, str]  # of clocks without, in the zone stated for them; only of methods with readings
    rois: dict[str, str]
    unread: list[str]  # frames of which nothing is known yet
    unusable: list[Cause]  # by role, of which there are frames and none that can be used: how many, and why
    outdated: list[str]  # ids of frames read by an earlier extractor or for another target: read again
    doubtful: tuple[Exclusion, ...]  # for no fit: left out by a person, or of doubtful pixels
    references: dict[str, list[dict[str, Any]]]  # what readings were made with, as it is now: meters, panels


def gather(
    session: Session,
    campaign: Campaign,
    *,
    applied: bool = False,
    frames: Sequence[FrameColumns] | None = None,
    memory: Memory | None = None,
) -> Evidence:
    """Frames with the statistics of the region that holds for them now, and the readings that stand."""
    spec = methods.get_method(campaign.method)
    roles = spec.role_names | spec.applied_role_names if applied else spec.role_names
    found = [row for row in frames or read_frames(session, campaign) if row.role in roles]
    rows = [row for row in found if row.state != "refused" and shared.FRAME_LEFT_OUT not in row.warnings]
    rows.sort(key=lambda row: (row.filename, row.sha256))
    regions = region_ids(session, campaign, rows)
    current = read_extractions(session, campaign, regions, memory=memory)
    names = _names(rows)
    read = [row for row in rows if _is_read(row)]
    readings, references = find_reference(session, campaign, spec, read)
    zones = read_zones(session, campaign) if spec.reference else Zones()
    offsets = {row.id: offset for row in read if (offset := find_offset(row.header, zones))}
    return Evidence(
        frames=[
            row.keep("row", given, partial(_make_row, spec, row, *given))
            for row in read
            for given in (
                (
                    *(names[row.id], current.get(row.id)),
                    *(spec.whole_frame or regions[row.id] is not None, offsets.get(row.id)),
                ),
            )
        ],
        readings=readings,
        names=names,
        hashes={names[row.id]: row.sha256 for row in read},
        headers={names[row.id]: row.header for row in read if row.header},
        offsets={names[frame_id]: offset for frame_id, offset in offsets.items()},
        rois={names[row.id]: current[row.id].roi_id for row in read if row.id in current},
        unread=[names[row.id] for row in rows if not _is_read(row)],
        unusable=_name_unusable(found, {row.role for row in rows}),
        outdated=list_outdated(session, campaign, regions, current),
        doubtful=tuple(
            Exclusion(
                frame=names[row.id], **(row.left_out or {"reason": row.describe_doubt(), "by": "stilb"})
            )
            for row in read
            if row.left_out or shared.IMAGE_PART_EMPTY in row.warnings
        ),
        references=references,
    )


def _name_unusable(rows: Sequence[FrameColumns], usable: Collection[str]) -> list[Cause]:
    refusals: dict[str, Counter[str | None]] = defaultdict(Counter)
    for row in rows:
        if row.role not in usable:
            refusals[row.role][row.refusal_detail] += 1
    found = []
    for role, why in sorted(refusals.items()):
        (refusal, count), total = why.most_common(1)[0], why.total()
        finding = shared.FRAME_NOT_READ if refusal else shared.FRAME_LEFT_OUT
        shown = "frame is there, not usable" if total == 1 else "frames are there, none usable"
        share = "" if count == total else f"{count} of them: "
        found.append(Cause(f"{total} {role} {shown}: {share}{refusal or finding.sentence}", finding))
    return found


def _is_read(row: FrameColumns) -> bool:
    """Return True if a frame can enter a fit: a chart may do without an exposure."""
    return row.header is not None and (row.exposure is not None or row.role == "chart")


def _names(rows: list[FrameColumns]) -> dict[str, str]:
    """The file's name, with a piece of its hash where two files share one."""
    shared = Counter(row.filename for row in rows)
    return {
        row.id: row.filename if shared[row.filename] == 1 else f"{row.filename} ({row.sha256[:8]})"
        for row in rows
    }


def _make_row(
    spec: MethodSpec,
    row: FrameColumns,
    name: str,
    extraction: ExtractionColumns | None,
    has_region: bool,  # noqa: FBT001  given in order
    clock_offset: str | None,
) -> Any:  # noqa: ANN401  the method's own
    assert row.header is not None  # noqa: S101  it has been read
    return spec.make_row(
        FrameEvidence(
            frame=name,
            role=row.role,
            scene=row.scene,
            header=replace(row.header, clock_offset=clock_offset) if clock_offset else row.header,
            exposure=row.exposure,
            statistics=extraction.statistics if extraction else None,
            features=extraction.features if extraction else None,
            has_region=has_region,
            identified=row.found.get("serial"),
        )
    )
