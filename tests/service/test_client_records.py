"""The client's records and details name what the document names, with its types."""

from dataclasses import fields
from datetime import datetime
from types import UnionType
from typing import get_args, get_origin, get_type_hints

import pytest

from service.http.document import resolve
from stilb import records

ANSWERS = {
    records.AuditChain: "AuditChainAnswer",
    records.AuditEntry: "AuditEntryAnswer",
    records.Calibration: "CalibrationAnswer",
    records.Camera: "CameraAnswer",
    records.Campaign: "CampaignAnswer",
    records.Coefficient: "CoefficientInForce",
    records.Comparison: "ContrastAnswer",
    records.Frame: "FrameAnswer",
    records.Job: "JobAnswer",
    records.Key: "KeyAnswer",
    records.KnownFrame: "KnownFrame",
    records.Measurement: "MeasurementAnswer",
    records.Meter: "MeterAnswer",
    records.OwnKey: "OwnKeyAnswer",
    records.Panel: "PanelAnswer",
    records.Reason: "ReasonAnswer",
    records.Rig: "RigAnswer",
}
FORMS = {
    records.CampaignChange: "CampaignChange",
    records.Grid: "NewGrid",
    records.MeasureDetails: "MeasurementOptions",
    records.PanelBand: "PanelBand",
}
OTHERWISE = {"polygon": "roi"}  # the client takes corners, the service also an ImageJ call
KINDS = {
    bool: {"boolean"},
    str: {"string"},
    int: {"integer"},
    float: {"number"},
    datetime: {"string"},
    tuple: {"array"},
    list: {"array"},
    dict: {"object"},
    records.Quantity: {"object"},
}


@pytest.fixture(scope="module")
def document(built_app):
    return built_app.openapi()


def kinds_of(hint):
    """The JSON types that a record's annotation takes; None where it takes any."""
    if get_origin(hint) is UnionType:
        return set().union(*(kinds_of(each) or set() for each in get_args(hint) if each is not type(None)))
    return KINDS.get(get_origin(hint) or hint)


@pytest.mark.parametrize(("record", "name"), ANSWERS.items())
def test_record_names_fields_of_its_answer(document, record, name):
    schema = document["components"]["schemas"][name]
    hints = get_type_hints(record)
    for field in fields(record):
        if field.name == "raw":
            continue
        known = resolve(document, schema["properties"][field.name])
        optional = type(None) in get_args(hints[field.name])
        assert field.name in schema.get("required", ()) or optional or field.default is not None
        assert known.get("type", "object") in kinds_of(hints[field.name]), field.name


@pytest.mark.parametrize(("details", "name"), FORMS.items())
def test_details_are_the_fields_of_their_form(document, details, name):
    schemas = document["components"]["schemas"]
    schema = schemas.get(name) or next(known for key, known in schemas.items() if key.startswith(name))
    taken = schema["properties"].keys() - {"products"}  # with_map
    assert taken == {OTHERWISE.get(field, field) for field in get_type_hints(details)}
