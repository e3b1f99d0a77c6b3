"""Everything a campaign has to offer to a fit, as the science wants it."""

from collections import Counter
from dataclasses import dataclass
from datetime import date
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.luminance.rows import FrameRow as FitFrame
from radiometry.luminance.rows import Reading as FitReading
from store.codec import decode_exposure, decode_statistics
from store.queries.frames import channel_rows, extractions_of
from store.tables import Campaign, ChannelRow, Extraction, FrameRow, Meter, Reading


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """Rows for the fit. ``names``: frame id to the fit's name of it; ``hashes``, ``rois``: by that name."""

    frames: list[FitFrame]
    readings: list[FitReading]
    names: dict[str, str]
    hashes: dict[str, str]
    rois: dict[str, str]
    unread: list[str]
    """Frames of which nothing is known yet."""
    meters: list[dict[str, Any]]
    """Each meter of the readings as engraved, with its certificate as it is now: a newer one replaces it."""


def gather(session: Session, campaign: Campaign, extractor: str) -> Evidence:
    """Frames with the statistics of the region that holds for them now, and the readings that stand."""
    rows = list(
        session.scalars(
            select(FrameRow)
            .where(FrameRow.campaign_id == campaign.id, FrameRow.state != "refused")
            .where(FrameRow.role.in_(("light", "dark")))
        )
    )
    rows.sort(key=lambda row: (row.filename, row.sha256))
    current = _current_extractions(session, campaign, rows, extractor)
    statistics = channel_rows(session, [extraction.id for extraction in current.values()])
    names = _names(rows)
    read = [row for row in rows if row.exposure is not None]
    return Evidence(
        frames=[
            _fit_frame(row, names[row.id], row.roi_id or campaign.roi_id, current.get(row.id), statistics)
            for row in read
        ],
        readings=_fit_readings(session, campaign),
        names=names,
        hashes={names[row.id]: row.sha256 for row in read},
        rois={names[row.id]: current[row.id].roi_id for row in read if row.id in current},
        unread=[names[row.id] for row in rows if row.exposure is None],
        meters=_meters(session, campaign),
    )


def _names(rows: list[FrameRow]) -> dict[str, str]:
    """The file's name, with a piece of its hash where two files share one."""
    shared = Counter(row.filename for row in rows)
    return {
        row.id: row.filename if shared[row.filename] == 1 else f"{row.filename} ({row.sha256[:8]})"
        for row in rows
    }


def _current_extractions(
    session: Session, campaign: Campaign, rows: list[FrameRow], extractor: str
) -> dict[str, Extraction]:
    current: dict[str, Extraction] = {}
    extractions = extractions_of(session, [row.id for row in rows])
    for row in rows:
        roi_id = row.roi_id or campaign.roi_id
        for extraction in extractions[row.id]:
            if extraction.roi_id == roi_id and extraction.extractor == extractor:
                current[row.id] = extraction
    return current


def _fit_frame(
    row: FrameRow,
    name: str,
    roi_id: str | None,
    extraction: Extraction | None,
    statistics: dict[str, list[ChannelRow]],
) -> FitFrame:
    header = row.header or {}
    opcodes = header.get("opcodes", [])
    return FitFrame(
        frame=name,
        role=row.role,
        scene=row.scene,
        exposure=decode_exposure(row.exposure or {}),
        statistics=tuple(map(decode_statistics, statistics[extraction.id])) if extraction else None,
        has_region=roi_id is not None,
        rendered=header.get("rendered", False),
        gain_maps=tuple(opcode["sha256"] for opcode in opcodes if opcode["name"] == "GainMap"),
    )


def _fit_readings(session: Session, campaign: Campaign) -> list[FitReading]:
    rows = session.execute(
        select(Reading, Meter)
        .outerjoin(Meter, Meter.id == Reading.meter_id)
        .where(Reading.campaign_id == campaign.id, Reading.withdrawn_at.is_(None))
    )
    readings = [
        FitReading(
            scene=reading.scene,
            quantity=reading.quantity,
            value=reading.value,
            meter=f"{meter.make} {meter.model} {meter.serial}" if meter else None,
            expanded_uncertainty_rel=meter.certificate_expanded_uncertainty_rel if meter else None,
            coverage_factor=meter.certificate_coverage_factor if meter else None,
        )
        for reading, meter in rows
    ]
    # by content, not by arrival, and here, since databases do not agree on the order of texts: neither the
    # last bit of K nor the content's hash may depend on either
    return sorted(readings, key=lambda reading: (reading.scene, reading.quantity, reading.value))


_ENGRAVED = ("kind", "make", "model", "serial")
_CERTIFICATE = ("number", "laboratory", "issued_on", "due_on", "expanded_uncertainty_rel", "coverage_factor")


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
