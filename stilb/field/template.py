"""The campaign.toml that `stilb campaign init` writes, from methods.json: what `GET /v1/methods` answers."""

import json
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from importlib.resources import files
from typing import Any

from stilb.records import DEFAULT_METHOD

_TEXT = """\
# One campaign: one camera, one method. Then: stilb campaign run {folder}

[camera]  # by the names that it writes into its files
make = {make}
model = {model}
serial = {serial}
# pixel_pitch_um = 3.28

[campaign]{kind}
{description}
method = {method}
project_number = {project_number}  # the same number again is the same campaign
# recorder = "A. Meier"
# place = "hangar 2"
# started_at = 2026-05-01T20:30:00Z
# time_zone = "Europe/Berlin"  # of the camera's clock, for files that state no offset
{stated}
{reference}
{target}
{frames}
# The region in pixels of the frame: corners, or what ImageJ's macro recorder writes. It may be drawn later.
# [region]
{region}
{last}
"""

_METER = """\
# The meter, with its certificate where it has one; one table a meter.
# [[meter]]
# kind = "luminance"
# make = "Konica Minolta"
# model = "LS-150"
# serial = "30011942"
# certificate = {{ number = "L-2026-0117", laboratory = "PTB", issued_on = 2026-01-17, due_on = 2027-01-17,\
 expanded_uncertainty_rel = 0.02, coverage_factor = 2 }}

# The readings: a spreadsheet saved as CSV with the columns scene, quantity, value, unit (cd/m2, fL, lx, fc).
{readings}
"""
_PANEL = """
# The panel as it was measured on a day: what it reflects in each band, and with what standard uncertainty.
# The serial alone takes a registered panel, or what its files state. Measured more than once: [[panel]].
# [panel]
# serial = "RP04-1832179-SC"
# measured_on = 2026-03-14
# bands = [\
{{ band = "green", reflectance = 0.49, standard_uncertainty = 0.005 }},\
 {{ band = "nir", reflectance = 0.48, standard_uncertainty = 0.005 }}]
"""
_FIT = """\
# Parameters of the fit. Remove the first # of a line to set one; otherwise the default shown is used.
[fit]"""
_MEASURE = "# How every frame is measured. Remove the first # of a line to set what is known.\n[measure]"
_FRAMES = """\
# Role and scene of each file are proposed from folders, pauses, exposure and brightness: stilb push --dry-run
# shows them. To state them instead: the first table that fits decides; a range of names needs no pattern.
# [[frames]]
# role = "light"
# scene = "level-1"
# first = "DJI_0001.DNG"
# last = "DJI_0012.DNG"
"""
_FIELD = "# Every raw file of the folder is a field frame."
_REFERENCES = {"meter": _METER, "panel": _PANEL, None: ""}
_ONE = '# imagej = "makePolygon(2200,1600,3100,1600,3100,2300,2200,2300);"\n'
_PARTS = """\
# [region.parts]
# centre = [[2200, 1600], [2400, 1600], [2400, 1800], [2200, 1800]]
# top-left = [[200, 160], [400, 160], [400, 360], [200, 360]]
"""


@cache
def read_methods() -> Mapping[str, Mapping[str, Any]]:
    """Return the methods by name, each as `GET /v1/methods` describes it."""
    text = files("stilb.field").joinpath("methods.json").read_text(encoding="utf-8")
    return {each["name"]: each for each in json.loads(text)["items"]}


def list_choices(method: str, parameter: str) -> dict[str, str]:
    """Return the values that a parameter of a fit may have, each with its label."""
    (found,) = [each for each in read_methods()[method]["parameters"] if each["name"] == parameter]
    return {choice["value"]: choice["label"] for choice in found["choices"]}


_LAMPS = [f"{kind} ({label})" for kind, label in list_choices(DEFAULT_METHOD, "lamp_kind").items()]
LAMP_HELP = f"Kind of lamp: {', '.join(_LAMPS)}."


def write_template(
    said: Mapping[str, str],
    *,
    folder: str,
    has_readings: bool,
    night: bool = False,
    light: Mapping[str, Any] | None = None,
) -> str:
    """Return the text; ``said``: make, model, serial, method, project_number, "" where not known."""
    method, mark = read_methods()[said["method"]], "" if has_readings else "# "
    readings = f'{mark}[readings]\n{mark}file = "readings.csv"'
    return _TEXT.format(
        folder=folder,
        description="\n".join(_comment(method["description"])),
        kind='\nkind = "measurement"' if night else "",
        reference="" if night else _REFERENCES[method.get("reference")].format(readings=readings),
        target="" if night else _format_target(method),
        frames=_FIELD if night else _FRAMES,
        region=_PARTS if method.get("several_regions") else _ONE,
        stated="\n".join(_list_parameters(_list_stated(method, night=night), "campaign", light or {})),
        last="\n".join([_MEASURE, *_list_parameters(method["conditions"], "request")])
        if night
        else "\n".join([_FIT, *_list_parameters(method["parameters"], "request")]),
        # A JSON text is a TOML text too.
        **{name: json.dumps(value, ensure_ascii=False) for name, value in said.items()},
    )


def _list_stated(method: Mapping[str, Any], *, night: bool) -> list[Mapping[str, Any]]:
    """Return the parameters that a campaign states; of a night those of its light."""
    light = {each["name"] for each in method["conditions"]}
    return [each for each in method["parameters"] if not night or each["name"] in light]


def _format_target(method: Mapping[str, Any]) -> str:
    if (example := method.get("target_example")) is None:
        return ""
    lines = [f"# {name} = {json.dumps(value)}" for name, value in example.items()]
    return "\n".join(["# What is photographed.", "# [target]", *lines, ""])


def _list_parameters(
    parameters: Sequence[Mapping[str, Any]], given_by: str, stated: Mapping[str, Any] | None = None
) -> Iterator[str]:
    for each in parameters:
        if each["given_by"] == given_by:
            *comment, line = _list_parameter(each)
            value = (stated or {}).get(each["name"])
            yield from (*comment, line if value is None else f"{each['name']} = {json.dumps(value)}")


def _list_parameter(parameter: Mapping[str, Any]) -> Iterator[str]:
    choices = ", ".join(json.dumps(choice["value"]) for choice in parameter["choices"])
    off = ' "none" switches it off.' if parameter["none_allowed"] else ""
    allowed = f" One of {choices}." if choices else ""
    unit = f" [{parameter['unit']}]" if parameter["unit"] != "1" else ""
    yield from _comment(f"{parameter['label']}{unit}: {parameter['description']}{allowed}{off}")
    if "default" in parameter:
        yield f"# {parameter['name']} = {json.dumps(parameter['default'])}"
    elif parameter["members"]:
        members = ", ".join(f"{each['name']} = {each['default']:.4g}" for each in parameter["members"])
        yield f"# {parameter['name']} = {{ {members} }}  # left out: {parameter['default_text']}"
    else:
        example = json.dumps(parameter["example"])
        yield f"# {parameter['name']} = {example}  # left out: {parameter['default_text']}"


def _comment(text: str) -> list[str]:
    return textwrap.wrap(text, 100, initial_indent="# ", subsequent_indent="#   ")
