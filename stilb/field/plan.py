"""campaign.toml: everything about a campaign that its files do not say. docs/command-line.md describes it."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import date, datetime, time
from pathlib import Path
from typing import Any, cast

from stilb.details import CameraDetails, CampaignDetails, MeasureDetails, Polygon, Reading
from stilb.field.files import NIGHT_RULES, ROLES, Rule
from stilb.names import quote
from stilb.problem import Unclear
from stilb.upload import FrameDetails

FILENAME = "campaign.toml"

_FEWEST_CORNERS = 3
_LENS = {"make", "model", "serial"}
_CERTIFICATE = {
    *("number", "laboratory", "issued_on", "due_on", "expanded_uncertainty_rel", "coverage_factor"),
}
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
        {"method", *CampaignDetails.__annotations__} - {"panel_id", "panel_serial", "target"},
        {"method", "project_number"},
    ),
    "panel": ({"serial", "measured_on", "bands"}, {"serial"}),
    "target": (set(), set()),
    "meter": ({"kind", "make", "model", "serial", "certificate"}, {"kind", "make", "model", "serial"}),
    "frames": ({"role", "pattern", "scene", "first", "last", *_EXPOSURE}, {"role"}),
    "readings": ({"file"}, {"file"}),
    "reading": (
        {"scene", "quantity", "value", "unit", "taken_at"},
        {"scene", "quantity", "value", "unit"},
    ),
    "region": ({"polygon", "imagej", "file", "parts"}, set()),
    "fit": (set(), set()),
    "measure": ({*MeasureDetails.__annotations__} - {"polygon"}, set()),
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
    camera: CameraDetails
    method: str
    project_number: str
    campaign: CampaignDetails
    panels: tuple[dict[str, Any], ...] = ()
    meters: tuple[dict[str, Any], ...] = ()
    rules: tuple[Rule, ...] = ()
    readings: tuple[Reading, ...] = ()
    readings_csv: str | None = None
    polygon: Polygon | None = None
    imagej: str | None = None
    parts: dict[str, Polygon] | None = None
    fit: dict[str, Any] = field(default_factory=dict)
    measure: MeasureDetails = field(default_factory=MeasureDetails)

    @property
    def kind(self) -> str:
        return self.campaign.get("kind", "calibration")


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
    for name in ({"meter", "reading", "readings", "panel", "target", "fit"} if night else {"measure"}) & set(
        said
    ):
        raise Unclear(
            f"[{name}] has no place in a campaign of the kind {campaign.get('kind', 'calibration')}"
        )
    csv = said.get("readings", {}).get("file")
    frames = said.get("frames")
    return Plan(
        make=camera.pop("make"),
        model=camera.pop("model"),
        serial=camera.pop("serial"),
        camera=cast("CameraDetails", camera),
        method=campaign.pop("method"),
        project_number=campaign["project_number"],
        campaign=cast("CampaignDetails", campaign),
        panels=_list_panels(said.get("panel", [])),
        meters=tuple(said.get("meter", ())),
        rules=(NIGHT_RULES if night else ()) if frames is None else tuple(map(_rule, frames)),
        readings=tuple(said.get("reading", ())),
        readings_csv=None if csv is None else read_spreadsheet(folder / csv),
        **_region(said.get("region", {}), folder),
        fit=said.get("fit", {}),
        measure=cast("MeasureDetails", measure),
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
    return Rule(**row, details=cast("FrameDetails", exposure))


def _region(said: dict[str, Any], folder: Path) -> dict[str, Any]:
    if len(said) > 1:
        raise Unclear("region needs exactly one of polygon, imagej, file and parts")
    if "polygon" in said:
        return {"polygon": _corners("polygon in region", said["polygon"])}
    if "parts" in said:
        if not isinstance(said["parts"], dict):
            raise Unclear(
                "parts in region must be written as [region.parts], one name and its corners per line"
            )
        return {"parts": {name: _corners(f"{name} in region", each) for name, each in said["parts"].items()}}
    if "file" in said:
        return {"imagej": read_macro(folder / said["file"])}
    return {"imagej": said.get("imagej")}


def _corners(what: str, said: Any) -> Polygon:  # noqa: ANN401  whatever TOML holds
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
        raise Unclear(
            f"{path} does not exist: put the file there, or remove the line that names it"
        ) from None


def read_macro(path: Path) -> str:
    """An ImageJ macro, as it is; its own .roi files are no text."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise Unclear(
            f"{path} contains no macro: record one in ImageJ (Plugins > Macros > Record)."
        ) from error


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
