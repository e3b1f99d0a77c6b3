"""What is known of a method by one specification: its answer, its form, what the form accepts and refuses."""

import math

import pytest
from pydantic import TypeAdapter, ValidationError

from radiometry.methods import METHODS, get_method
from radiometry.methods.findings import FINDINGS
from radiometry.specification.parameters import Parameter
from service.calibrations.methods import NewCalibration, read_kind, read_request
from service.http.problems import Problem

pytestmark = pytest.mark.either_database

NUMBERS = [
    (spec, each)
    for spec in METHODS
    for each in spec.parameters
    if each.kind == "number" and each.given_by == "request"
]


def read(name, /, **sent):
    spec = get_method(name)
    return read_request(NewCalibration(sent), spec).read_parameters(spec)


def test_every_method_is_listed_with_its_parameters(house):
    items = {item["name"]: item for item in house.get("/v1/methods")["items"]}
    assert list(items) == [spec.name for spec in METHODS]
    tolerance = next(each for each in items["luminance"]["parameters"] if each["name"] == "tolerance")
    assert (tolerance["type"], tolerance["minimum"], tolerance["maximum"], tolerance["default"]) == (
        *("number", 0.0, 1.0, 0.04),
    )
    assert (tolerance["field"], tolerance["label"], tolerance["unit"]) == ("tolerance_rel", "Tolerance", "1")
    assert items["geometry"]["roles"][0]["name"] == "chart"
    assert items["luminance"]["coefficients"][0]["name"] == "luminance_k"


@pytest.mark.parametrize(("spec", "each"), NUMBERS, ids=lambda each: each.name)
def test_the_form_accepts_what_the_parameters_accept(spec, each):
    """Just inside and just outside of both bounds, the form and the dataclass agree."""
    for bound, away in ((each.minimum, -1), (each.maximum, 1)):
        for value in (bound, math.nextafter(bound, away * math.inf), math.nextafter(bound, -away * math.inf)):
            try:
                spec.params(**{each.field: value})
            except ValueError:
                with pytest.raises(Problem, match=each.name):
                    read(spec.name, **{each.name: value})
            else:
                assert read(spec.name, **{each.name: value}) == {each.field: value}


def test_the_defaults_may_be_sent():
    for spec in METHODS:
        sent = {each.name: each.default for each in spec.parameters if each.default is not None}
        sent = {name: list(value) if isinstance(value, tuple) else value for name, value in sent.items()}
        assert (
            spec.params(
                **{
                    name: tuple(value) if isinstance(value, list) else value
                    for name, value in read(spec.name, **sent).items()
                }
            )
            == spec.params()
        )


def test_neither_true_nor_a_text_is_a_number():
    assert read("geometry", radial_terms=1) == {"radial_terms": 1}
    for wrong in (True, False, "1"):
        with pytest.raises(Problem, match="radial_terms: must be"):
            read("geometry", radial_terms=wrong)


def test_what_is_switched_off_is_sent_by_name():
    assert read("geometry", reject_above_px="none") == {"reject_above_px": None}
    with pytest.raises(Problem, match="reject_above_px: must be 'none'"):
        read("geometry", reject_above_px="off")
    with pytest.raises(Problem, match="star_contrast: must be a number"):
        read("sharpness", star_contrast="none")


@pytest.mark.parametrize("spec", METHODS, ids=lambda spec: spec.name)
def test_a_parameter_of_another_method_is_refused_by_name(spec):
    own = {each.name for each in spec.parameters}
    for other in METHODS:
        for each in other.parameters:
            if each.name not in own and each.given_by == "request":
                with pytest.raises(Problem, match=f"{each.name}: is not a parameter of a {spec.name} fit"):
                    read(spec.name, **{each.name: each.default if each.default is not None else 1})


def test_what_the_campaign_states_is_no_parameter_of_a_request():
    with pytest.raises(Problem, match="panel_rho: is not a parameter of a luminance fit"):
        read("luminance", panel_rho=0.18)


def test_a_request_may_name_its_method_and_not_another():
    assert read("luminance", method="luminance", tolerance=0.05) == {"tolerance_rel": 0.05}
    with pytest.raises(Problem, match="method: must be 'noise'"):
        read("noise", method="luminance")


def test_a_whole_number_is_asked_for_as_one():
    counted = Parameter(field="n", name="n", label="N", description="How many.", kind="integer", minimum=1.0)
    form = TypeAdapter(read_kind(counted))
    assert form.validate_python(2) == 2
    for wrong in (2.5, 0, "2", True):
        with pytest.raises(ValidationError):
            form.validate_python(wrong)


def test_every_finding_is_listed_with_sentence_and_remedy(house):
    items = {item["code"]: item for item in house.get("/v1/findings")["items"]}
    assert [*items] == [*FINDINGS]
    assert items["lamp_drift"] == {
        "code": "lamp_drift",
        "severity": "warn",
        "where": ["verdict", "calibration"],
        "sentence": FINDINGS["lamp_drift"].sentence,
        "remedy": FINDINGS["lamp_drift"].remedy,
        "retryable": False,
    }
    assert (items["not_found"]["status"], items["storage_full"]["retryable"]) == (404, True)
    assert items["place_missing"]["where"] == ["certificate"]


def test_an_unchanged_registry_is_not_sent_again(house):
    tag = house.http.get("/v1/findings").headers["ETag"]
    assert house.http.get("/v1/findings", headers={"If-None-Match": tag}).status_code == 304
