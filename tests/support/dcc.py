"""The order and number of children in a DCC of version 3.1.2, as far as the certificates use it."""

import re
import xml.etree.ElementTree as ET

_CHILDREN = {
    "digitalCalibrationCertificate": "administrativeData measurementResults document",
    "administrativeData": "dccSoftware coreData items calibrationLaboratory respPersons customer statements",
    "dccSoftware": "software+",
    "usedSoftware": "software+",
    "software": "name release",
    "coreData": "countryCodeISO3166_1 usedLangCodeISO639_1+ mandatoryLangCodeISO639_1+ uniqueIdentifier "
    "identifications? beginPerformanceDate endPerformanceDate performanceLocation",
    "identifications": "identification+",
    "identification": "issuer value name?",
    "items": "item+",
    "item": "name description? manufacturer model? identifications",
    "calibrationLaboratory": "contact",
    "contact": "name eMail location",
    "customer": "name eMail location",
    "location": "countryCode? further",
    "respPersons": "respPerson+",
    "respPerson": "person mainSigner?",
    "person": "name",
    "manufacturer": "name",
    "statements": "statement+",
    "statement": "declaration",
    "measurementResults": "measurementResult+",
    "measurementResult": "name usedMethods usedSoftware measuringEquipments? influenceConditions results",
    "usedMethods": "usedMethod+",
    "usedMethod": "name description?",
    "measuringEquipments": "measuringEquipment+",
    "measuringEquipment": "name description? manufacturer? model? identifications?",
    "influenceConditions": "influenceCondition+",
    "influenceCondition": "name data",
    "results": "result+",
    "result": "name data",
    "data": "text* quantity*",
    "quantity": "description? real",
    "real": "value unit expandedUnc?",
    "expandedUnc": "uncertainty coverageFactor coverageProbability",
    "document": "fileName mimeType dataBase64",
    **dict.fromkeys(("name", "description", "declaration", "further", "text"), "content+"),
}
_TEXTS = {
    "countryCodeISO3166_1": "[A-Z]{2}",
    "countryCode": "[A-Z]{2}",
    "beginPerformanceDate": r"\d{4}-\d\d-\d\d",
    "endPerformanceDate": r"\d{4}-\d\d-\d\d",
    "performanceLocation": "laboratory|customer|laboratoryBranch|customerBranch|other",
    "release": r"[a-zA-Z]( )?(\d{1,3}\.){0,3}\d{1,3}",
    "eMail": ".+",
    "issuer": "manufacturer|calibrationLaboratory|customer|owner|other",
    "mainSigner": "true|false",
    "unit": r"(\\[a-z]+(\\tothe\{-?\d+\})?)+",
    "uncertainty": r"\d+(\.\d+)?(e[-+]?\d+)?",
    "coverageFactor": r"[1-9]\d*(\.\d*)?",
    "coverageProbability": r"0(\.\d*)?|1(\.0*)?",
}


def read_dcc(content: bytes) -> ET.Element:
    """Return the root, with bare names; an assertion fails where the document is not a DCC 3.1.2."""
    root = ET.fromstring(content)
    assert root.attrib == {"schemaVersion": "3.1.2"}
    for element in root.iter():
        space, _, element.tag = element.tag.rpartition("}")
        among_si = element.tag in {"real", *_CHILDREN["real"].replace("?", "").split()}
        among_si |= element.tag in _CHILDREN["expandedUnc"].split()
        if element.tag != "value":
            assert space == ("{https://ptb.de/si" if among_si else "{https://ptb.de/dcc"), element.tag
    for element in root.iter():
        children = " ".join(child.tag for child in element) + " "
        stated = _CHILDREN.get(element.tag, "").split()
        form = "".join(f"({name.rstrip('*+?')} ){name[len(name.rstrip('*+?')) :]}" for name in stated)
        assert re.fullmatch(form or " ", children), (element.tag, children)
        if element.tag in _TEXTS:
            assert re.fullmatch(_TEXTS[element.tag], element.text), (element.tag, element.text)
    return root
