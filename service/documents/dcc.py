"""The certificate as a Digital Calibration Certificate (DCC 3.1.2 of PTB), its units as D-SI writes them."""

import base64
from functools import cache
from pathlib import Path
from typing import Any, Final

from jinja2 import Environment, FileSystemLoader, Template

from radiometry.methods import get_method
from radiometry.specification.exports import FORBIDDEN_IN_XML
from service.documents import pages, sheets

_UNITS: Final = {
    **dict.fromkeys(("1", "DN", "px", "e-", "stop", "cycles", "LP", "LW", "PH", "lp"), ""),
    "cd": r"\candela",
    "dB": r"\decibel",
    "m": r"\metre",
    "mm": r"\milli\metre",
    "nm": r"\nano\metre",
    "s": r"\second",
    "sr": r"\steradian",
    "W": r"\watt",
}
"""What is counted, such as DN, pixels and stops, is of unit one."""


def write_dcc(certificate: sheets.Node, *, country: str, state: str, document: bytes) -> bytes:
    """Write a certificate that has a customer and days, with its JSON; `country`: two letters of ISO 3166."""
    labels = {each.name: each.label for each in get_method(certificate["method"]).coefficients}
    stamp, software = pages.STAMPS[state], certificate["software"]
    written = _template().render(
        certificate,
        country=country,
        document=base64.b64encode(document).decode(),
        declarations=[
            *([f"{stamp}."] if stamp else []),
            certificate["traceability"],
            *certificate["statements"],
        ],
        # the schema has no place for a development release
        release="v" + software.get("release", software["stilb"]).partition(".dev")[0],
        name_row=lambda row: _name_row(row, labels),
    )
    return written.encode()


def write_unit(unit: str) -> str:
    r"""Return a unit as D-SI writes it: DN/s is \second\tothe{-1}."""
    above, _, below = unit.partition("/")
    written = ""
    for part, sign in ((above, 1), (below.strip("()"), -1)):
        for factor in filter(None, part.split("*")):
            name = factor if factor in _UNITS else factor.rstrip("0123456789")
            power = sign * int(factor[len(name) :] or 1)
            symbol = _UNITS[name]
            written += symbol if power == 1 or not symbol else f"{symbol}\\tothe{{{power}}}"
    return written or r"\one"


def _name_row(row: sheets.Node, labels: dict[str, str]) -> str:
    places = {"iso": "ISO {:g}", "f_number": "f/{:g}", "band": "{}", "channel": "{}"}
    held = [form.format(row[name]) for name, form in places.items() if name in row]
    unit = "" if row["unit"] == "1" else f" [{row['unit']}]"
    return ", ".join([labels[row["name"]] + unit, *held])


@cache
def _template() -> Template:
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_keep_to_xml,
    )
    environment.globals |= {
        "unknown": "not recorded",
        "name_device": sheets.name_device,
        "write_unit": write_unit,
    }
    return environment.get_template("dcc.xml")


def _keep_to_xml(value: Any) -> Any:  # noqa: ANN401  whatever a template shows
    return FORBIDDEN_IN_XML.sub("\ufffd", value) if type(value) is str else value
