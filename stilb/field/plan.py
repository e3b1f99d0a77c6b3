"""campaign.toml: everything about a campaign that its files do not say. docs/command-line.md describes it."""

import hashlib
import itertools
import json
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date, datetime, time
from pathlib import Path
from typing import Any, cast

from stilb import records, upload
from stilb.client import Client
from stilb.field.files import NIGHT_RULES, ROLES, Rule, quote
from stilb.problem import Unclear

FILENAME = "campaign.toml"

_FEWEST_CORNERS = 3
_LENS = {"make", "model", "serial"}
_CERTIFICATE = {"number", "laboratory", "issued_on", "due_on", "expanded_uncertainty_rel", "coverage_factor"}
_EXPOSURE = {"exposure_time_s", "f_number", "iso"}
# A name of the service's library, or a file.
_CURVES = frozenset({"lamp", "camera_response", "light_source"})
# Of each table what it may hold, and of that what must not be left empty.
_TABLES: dict[str, tuple[set[str], set[str]]] = {
    "camera": (
        {"make", "model", "serial", "lens", "pixel_pitch_um", "sensor_width_mm", "note"},
        {"make", "model", "serial"},
    ),
    "campaign": (
        {"method", *records.CampaignDetails.__annotations__} - {"panel_id", "panel_serial", "target"},
        {"method", "project_number"},
    ),
    "panel": ({"serial", "measured_on", "bands"}, {"serial"}),
    "target": (set(), set()),
    "meter": ({"kind", "make", "model", "serial", "certificate"}, {"kind", "make", "model", "serial"}),
    "frames": ({"role", "pattern", "scene", "first", "last", *_EXPOSURE}, {"role"}),
    "readings": ({"file"}, {"file"}),
    "reading": (
        {"scene", "quantity", "value", "unit", "taken_at", "reason"},
        {"scene", "quantity", "value", "unit"},
    ),
    "region": ({"polygon", "imagej", "file", "parts"}, set()),
    "fit": (set(), set()),
    "measure": ({*records.MeasureDetails.__annotations__} - {"polygon"}, set()),
}
_LISTS = frozenset({"meter", "frames", "reading"})
# A table, or several: a panel that was measured more than once.
_EITHER = frozenset({"panel"})
_NEEDED = frozenset({"camera", "campaign"})


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Content of campaign.toml.

    ``panels``: as `Client.create_panel` takes them, or one by its serial alone; ``rules``: none if the
    service proposes roles and scenes; ``readings_csv``: the text of the spreadsheet; of ``polygon``,
    ``imagej`` and ``parts`` one at most.
    """

    make: str
    model: str
    serial: str
    camera: dict[str, Any]
    method: str
    project_number: str
    campaign: dict[str, Any]
    panels: tuple[dict[str, Any], ...] = ()
    meters: tuple[dict[str, Any], ...] = ()
    rules: tuple[Rule, ...] = ()
    readings: tuple[records.Reading, ...] = ()
    readings_csv: str | None = None
    polygon: records.Polygon | None = None
    imagej: str | None = None
    parts: dict[str, records.Polygon] | None = None
    fit: dict[str, Any] = field(default_factory=dict)
    measure: dict[str, Any] = field(default_factory=dict)

    @property
    def kind(self) -> str:
        return str(self.campaign.get("kind", "calibration"))


def read_plan(folder: Path) -> Plan:
    """Read a folder's campaign.toml and the files that it names; ``Unclear`` says what is wrong and where."""
    path = folder / FILENAME
    try:
        said = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise Unclear(f"{path} does not exist. Create it: stilb campaign init {quote(folder)}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise Unclear(
            f"{path} cannot be read: {error}. Compare it with the file that stilb campaign init writes "
            "into an empty folder."
        ) from error
    try:
        return _plan(_plain(said), folder)
    except Unclear as error:
        raise Unclear(f"{path}: {error}") from error


def _plan(said: dict[str, Any], folder: Path) -> Plan:
    _check(said)
    camera, campaign = said["camera"], said["campaign"]
    if "target" in said:
        campaign["target"] = said["target"]
    measure = said.get("measure", {})
    for table in (campaign, measure):
        for name in _CURVES & set(table):
            if str(table[name]).lower().endswith(".csv"):
                table[name] = read_spreadsheet(folder / table[name])
    night = campaign.get("kind") == "measurement"
    foreign = {"meter", "reading", "readings", "panel", "target", "fit"} if night else {"measure"}
    for name in sorted(foreign & set(said)):
        kind = campaign.get("kind", "calibration")
        raise Unclear(f"[{name}] has no place in a campaign of the kind {kind}")
    csv = said.get("readings", {}).get("file")
    frames = said.get("frames")
    return Plan(
        **{name: camera.pop(name) for name in ("make", "model", "serial")},
        camera=camera,
        method=campaign.pop("method"),
        project_number=campaign["project_number"],
        campaign=campaign,
        panels=_list_panels(said.get("panel", [])),
        meters=tuple(said.get("meter", ())),
        rules=(NIGHT_RULES if night else ()) if frames is None else tuple(map(_rule, frames)),
        readings=tuple(said.get("reading", ())),
        readings_csv=None if csv is None else read_spreadsheet(folder / csv),
        **_region(said.get("region", {}), folder),
        fit=said.get("fit", {}),
        measure=measure,
    )


def _list_panels(said: dict[str, Any] | list[dict[str, Any]]) -> tuple[dict[str, Any], ...]:
    """One table, or one a measurement; without figures the panel is the one that the frames name."""
    panels = said if isinstance(said, list) else [said]
    for panel in panels:
        if len(panels) > 1 or len(panel) > 1:
            for name in sorted({"measured_on", "bands"} - {name for name, value in panel.items() if value}):
                raise Unclear(f"{name} in panel is not filled in; only the serial stands alone")
    if len({panel["serial"] for panel in panels}) > 1:
        raise Unclear("panel has several serials: a campaign has one panel, measured once or several times")
    return tuple(panels)


def _check(said: Mapping[str, Any]) -> None:
    """Name the first table or key that is unknown, missing or empty."""
    _known("", set(said), set(_TABLES))
    for name in sorted(_NEEDED - set(said)):
        raise Unclear(f"the table [{name}] is missing")
    for name, value in said.items():
        allowed, needed = _TABLES[name]
        listed = name in _LISTS or (name in _EITHER and isinstance(value, list))
        rows = value if listed else [value]
        if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
            raise Unclear(f"{name} must be written as {f'[[{name}]]' if name in _LISTS else f'[{name}]'}")
        for number, row in enumerate(rows, start=1):
            where = f"{name} {number}" if listed else name
            if allowed:
                _known(f" in {where}", set(row), allowed)
            for key in sorted(key for key in needed if row.get(key) in (None, "", [])):
                raise Unclear(f"{key} in {where} is not filled in")
            _known(f" in the lens of {where}", set(row.get("lens", ())), _LENS)
            _known(f" in the certificate of {where}", set(row.get("certificate", ())), _CERTIFICATE)


def _known(where: str, found: set[str], allowed: set[str]) -> None:
    for name in sorted(found - allowed):
        raise Unclear(f"{name!r}{where} is unknown; allowed are {', '.join(sorted(allowed))}")


def _rule(row: dict[str, Any]) -> Rule:
    if row["role"] not in ROLES:
        raise Unclear(f"role {row['role']!r} in frames is unknown; use one of {', '.join(ROLES)}")
    if not {"pattern", "first", "last"} & set(row):
        raise Unclear(f"frames with the role {row['role']} need a pattern, or first and last")
    exposure = {name: row.pop(name) for name in _EXPOSURE & set(row)}
    return Rule(**row, details=cast("upload.FrameDetails", exposure))


def _region(said: dict[str, Any], folder: Path) -> dict[str, Any]:
    if len(said) > 1:
        raise Unclear("region needs exactly one of polygon, imagej, file and parts")
    if "polygon" in said:
        return {"polygon": _corners("polygon in region", said["polygon"])}
    if "parts" in said:
        if not isinstance(said["parts"], dict):
            message = "parts in region must be written as [region.parts], one name and its corners per line"
            raise Unclear(message)
        return {"parts": {name: _corners(f"{name} in region", each) for name, each in said["parts"].items()}}
    if "file" in said:
        return {"imagej": read_macro(folder / said["file"])}
    return {"imagej": said.get("imagej")}


def _corners(what: str, said: Any) -> records.Polygon:  # noqa: ANN401  whatever TOML holds
    try:
        corners = tuple((float(x), float(y)) for x, y in said)
    except (ValueError, TypeError):
        corners = ()
    if len(corners) < _FEWEST_CORNERS:
        raise Unclear(f"{what} must be three corners or more: [[x, y], [x, y], [x, y]]")
    return corners


def read_spreadsheet(path: Path) -> str:
    """As it is; a spreadsheet's other encodings are told to the person here, before anything is sent."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise Unclear(f"{path} is not UTF-8. Save it as CSV UTF-8.") from error
    except FileNotFoundError:
        message = f"{path} does not exist: put the file there, or remove the line that names it"
        raise Unclear(message) from None


def read_macro(path: Path) -> str:
    """An ImageJ macro, as it is; its own .roi files are no text."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        message = f"{path} contains no macro: record one in ImageJ (Plugins > Macros > Record)."
        raise Unclear(message) from error


def _plain(value: Any) -> Any:  # noqa: ANN401  whatever TOML holds
    """Dates and times as texts, as the service reads them."""
    match value:
        case dict():
            return {name: _plain(member) for name, member in value.items()}
        case list():
            return [_plain(member) for member in value]
        case datetime() if value.tzinfo is None:
            raise Unclear(f"{value.isoformat()} has no time zone: write 2026-05-01T20:30:00Z or ...+02:00")
        case datetime() | date() | time():
            return value.isoformat()
        case _:
            return value


def find_planned(client: Client, plan: Plan) -> records.Campaign | None:
    """The campaign that the plan has made before: of its camera, with its project number and kind."""
    for camera in client.cameras(make=plan.make, model=plan.model, serial=plan.serial):
        for known in client.campaigns(camera_id=camera.id, project_number=plan.project_number):
            if known.kind == plan.kind:
                return known
    return None


def ensure_campaign(client: Client, plan: Plan) -> records.Campaign:
    """The plan's campaign, made where there is none, with what the plan says of it now, and its region."""
    measured = [client.create_panel(**panel).id for panel in plan.panels if "bands" in panel]
    details = {**plan.campaign, "panel_id": measured[-1]} if measured else plan.campaign
    campaign = find_planned(client, plan)
    campaign = _correct(client, campaign, details) if campaign else _create(client, plan, details)
    if plan.parts is not None:
        client.set_roi(campaign.id, regions=plan.parts)
    elif plan.polygon is not None:
        client.set_roi(campaign.id, polygon=plan.polygon)
    elif plan.imagej is not None:
        client.set_roi(campaign.id, imagej=plan.imagej)
    return campaign


def ensure_panel(client: Client, plan: Plan, campaign_id: str) -> None:
    """Name the panel that the plan gives by its serial alone, once the frames are read that state it."""
    if plan.panels and "bands" not in plan.panels[0]:
        client.wait_for(campaign_id)
        client.change_campaign(campaign_id, panel_serial=plan.panels[0]["serial"])


def list_parameters(plan: Plan) -> dict[str, Any]:
    """The parameters of the fit; of a panel that the plan gives one measurement of, that one is used."""
    days = [panel["measured_on"] for panel in plan.panels if "bands" in panel]
    return {**({"panel_measured_on": days[0]} if len(days) == 1 else {}), **plan.fit}


def ensure_readings(client: Client, plan: Plan, campaign_id: str) -> tuple[int, list[str]]:
    """Send the plan's readings once: how many they are, and the ids of others that the campaign has."""
    meters = [client.create_meter(**meter).id for meter in plan.meters]
    own: set[str] = set()
    for readings in (plan.readings_csv, plan.readings):
        if readings:
            own |= _send_once(client, campaign_id, readings, meters)
    others = [each["id"] for each in _in_use(client, campaign_id) if each["id"] not in own]
    return len(own), others


def _correct(client: Client, campaign: records.Campaign, details: dict[str, Any]) -> records.Campaign:
    """Correct the details that differ; a time may be written in several ways, so it stays."""
    said = {name: value for name, value in details.items() if name not in {"started_at", "ended_at"}}
    changed = {name: value for name, value in said.items() if not _holds(campaign.raw.get(name), value)}
    return client.change_campaign(campaign.id, **changed) if changed else campaign


def _holds(stored: object, said: object) -> bool:
    """The service writes a target's defaults out: what was said must be in it, more may be."""
    if isinstance(stored, dict) and isinstance(said, dict):
        return stored.keys() >= said.keys() and all(_holds(stored[name], said[name]) for name in said)
    return stored == said


def _create(client: Client, plan: Plan, details: dict[str, Any]) -> records.Campaign:
    camera = client.create_camera(plan.make, plan.model, plan.serial, **plan.camera)
    # Two runs that begin at once, or one that is killed before its answer, make one campaign.
    key = _digest("campaign", camera.id, plan.method, details)
    return client.create_campaign(camera.id, method=plan.method, idempotency_key=key, **details)


def _send_once(
    client: Client, campaign_id: str, readings: str | Sequence[records.Reading], meters: list[str]
) -> set[str]:
    """The same readings again are those that are there, unless all of them have been withdrawn since."""
    for attempt in itertools.count():
        key = _digest("readings", campaign_id, readings, meters, attempt)
        answer = client.add_readings(campaign_id, readings, meter_ids=meters, idempotency_key=key)
        ids = {each["id"] for each in answer}
        if ids & {each["id"] for each in _in_use(client, campaign_id)}:
            return ids
    raise AssertionError("unreachable")


def _in_use(client: Client, campaign_id: str) -> list[dict[str, Any]]:
    return [each for each in client.readings(campaign_id) if "withdrawn_at" not in each]


def _digest(*said: object) -> str:
    return hashlib.sha256(json.dumps(said, sort_keys=True, default=list).encode()).hexdigest()
