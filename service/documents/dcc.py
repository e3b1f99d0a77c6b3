"""The certificate as a Digital Calibration Certificate (DCC 3.1.2 of PTB), its units as D-SI writes them."""

import base64
import xml.etree.ElementTree as ET
from typing import Final

from radiometry.methods import get_method
from radiometry.specification.exports import FORBIDDEN_IN_XML
from service.documents import pages, sheets

_VERSION: Final = "3.1.2"
_UNKNOWN: Final = "not recorded"
_PROBABILITY: Final = "0.95"
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
    """Write a certificate that has a customer and days, with its JSON as the document.

    ``country`` : of the laboratory, two letters of ISO 3166. ``state`` : which it is marked with
    """
    root = ET.Element("dcc:digitalCalibrationCertificate", schemaVersion=_VERSION)
    root.set("xmlns:dcc", "https://ptb.de/dcc")
    root.set("xmlns:si", "https://ptb.de/si")
    administrative = _add(root, "administrativeData")
    _add_software(_add(administrative, "dccSoftware"), certificate)
    _add_core(_add(administrative, "coreData"), certificate, country)
    _add_item(_add(administrative, "items"), certificate)
    laboratory = certificate["laboratory"]
    contact = _add(_add(administrative, "calibrationLaboratory"), "contact")
    _add_contact(contact, laboratory["name"], laboratory.get("address"), country)
    person = _add(_add(administrative, "respPersons"), "respPerson")
    approved = certificate.get("approved_by")
    _say(_add(person, "person"), "name", str(approved["name"] if approved else certificate["author"]))
    _add(person, "mainSigner", "true" if approved else "false")
    _add_contact(_add(administrative, "customer"), certificate["work"]["customer"], None, None)
    statements = _add(administrative, "statements")
    stamp = pages.STAMPS[state]
    for words in [*([f"{stamp}."] if stamp else []), certificate["traceability"], *certificate["statements"]]:
        _say(_add(statements, "statement"), "declaration", words)
    _add_result(_add(_add(root, "measurementResults"), "measurementResult"), certificate)
    attached = _add(root, "document")
    _add(attached, "fileName", "certificate.json")
    _add(attached, "mimeType", "application/json")
    _add(attached, "dataBase64", base64.b64encode(document).decode())
    ET.indent(root)
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode").encode()


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


def _add_software(parent: ET.Element, certificate: sheets.Node) -> None:
    software = _add(parent, "software")
    _say(software, "name", "stilb")
    release = certificate["software"].get("release", certificate["software"]["stilb"])
    # the schema has no place for a development release
    _add(software, "release", "v" + release.partition(".dev")[0])


def _add_core(core: ET.Element, certificate: sheets.Node, country: str) -> None:
    work = certificate["work"]
    _add(core, "countryCodeISO3166_1", country)
    _add(core, "usedLangCodeISO639_1", "en")
    _add(core, "mandatoryLangCodeISO639_1", "en")
    _add(core, "uniqueIdentifier", f"{certificate['number']} {certificate['content_sha256']}")
    if "project_number" in work:
        _identify(_add(core, "identifications"), "calibrationLaboratory", work["project_number"], "project")
    _add(core, "beginPerformanceDate", work["first_day"])
    _add(core, "endPerformanceDate", work["last_day"])
    _add(core, "performanceLocation", "other")


def _add_item(items: ET.Element, certificate: sheets.Node) -> None:
    said = certificate["item"]
    item = _add(items, "item")
    _say(item, "name", "camera")
    if "lens" in said:
        _say(item, "description", f"Lens: {sheets.name_device(said['lens'])}")
    _say(_add(item, "manufacturer"), "name", said["make"])
    _add(item, "model", said["model"])
    _identify(_add(item, "identifications"), "manufacturer", said["serial"], "serial number")


def _add_result(result: ET.Element, certificate: sheets.Node) -> None:
    _say(result, "name", certificate["title"])
    method = _add(_add(result, "usedMethods"), "usedMethod")
    _say(method, "name", certificate["procedure"])
    _say(method, "description", certificate["equation"])
    _add_software(_add(result, "usedSoftware"), certificate)
    references = [(f"{one['kind']} meter", one) for one in certificate["meters"]]
    references += [("reflectance panel", one) for one in certificate["panels"]]
    if references:
        equipments = _add(result, "measuringEquipments")
    for name, one in references:
        equipment = _add(equipments, "measuringEquipment")
        _say(equipment, "name", name)
        if "certificate" in one:
            _say(equipment, "description", f"Certificate {one['certificate']['number']}")
        if "make" in one:
            _say(_add(equipment, "manufacturer"), "name", one["make"])
            _add(equipment, "model", one["model"])
        _identify(_add(equipment, "identifications"), "manufacturer", one["serial"], "serial number")
    condition = _add(_add(result, "influenceConditions"), "influenceCondition")
    _say(condition, "name", "conditions")
    _say(_add(condition, "data"), "text", certificate["work"].get("conditions", _UNKNOWN))
    labels = {each.name: each.label for each in get_method(certificate["method"]).coefficients}
    results = _add(result, "results")
    for row in certificate["coefficients"]:
        one = _add(results, "result")
        places = {"iso": "ISO {:g}", "f_number": "f/{:g}", "band": "{}", "channel": "{}"}
        held = [form.format(row[name]) for name, form in places.items() if name in row]
        unit = "" if row["unit"] == "1" else f" [{row['unit']}]"
        _say(one, "name", ", ".join([labels[row["name"]] + unit, *held]))
        _add_quantity(_add(_add(one, "data"), "quantity"), row)


def _add_quantity(quantity: ET.Element, row: sheets.Node) -> None:
    if "expanded_uncertainty" not in row:
        words = (
            f"Standard uncertainty {row['standard_uncertainty']!r}, of ratios: the scale is not traceable."
        )
        _say(quantity, "description", words)
    real = ET.SubElement(quantity, "si:real")
    ET.SubElement(real, "si:value").text = repr(row["value"])
    ET.SubElement(real, "si:unit").text = write_unit(row["unit"])
    if "expanded_uncertainty" in row:
        expanded = ET.SubElement(real, "si:expandedUnc")
        ET.SubElement(expanded, "si:uncertainty").text = repr(row["expanded_uncertainty"])
        ET.SubElement(expanded, "si:coverageFactor").text = repr(row["coverage_factor"])
        ET.SubElement(expanded, "si:coverageProbability").text = _PROBABILITY


def _add_contact(contact: ET.Element, name: str, address: str | None, country: str | None) -> None:
    _say(contact, "name", name)
    _add(contact, "eMail", _UNKNOWN)
    location = _add(contact, "location")
    if country:
        _add(location, "countryCode", country)
    _say(location, "further", address or _UNKNOWN)


def _identify(identifications: ET.Element, issuer: str, value: str, name: str) -> None:
    identification = _add(identifications, "identification")
    _add(identification, "issuer", issuer)
    _add(identification, "value", value)
    _say(identification, "name", name)


def _say(parent: ET.Element, tag: str, words: str) -> None:
    _add(_add(parent, tag), "content", words).set("lang", "en")


def _add(parent: ET.Element, tag: str, text: str | None = None) -> ET.Element:
    element = ET.SubElement(parent, f"dcc:{tag}")
    element.text = None if text is None else FORBIDDEN_IN_XML.sub("\ufffd", text)
    return element
