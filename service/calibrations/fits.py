"""Requests to fit a campaign: one form per method, derived from the method's parameters."""

from collections.abc import Iterable
from typing import Annotated, Any, Literal

from pydantic import (
    BeforeValidator,
    Discriminator,
    Field,
    RootModel,
    Strict,
    Tag,
    ValidationError,
    create_model,
)
from pydantic.json_schema import models_json_schema
from pydantic_core import PydanticCustomError

from radiometry import methods
from radiometry.specification.method import MethodSpec
from radiometry.specification.parameters import Parameter
from service.http.models import WHOLE, CurveText, Form, LongText, Text
from service.http.problems import AS_NUMBER, BY_NAME, invalid, located

NONE = "none"
"""Switches off a parameter that has a default."""


class Exclusion(Form):
    """A frame that the fit leaves out, and why."""

    frame_id: Text
    reason: LongText


class FitRequest(Form):
    """Fields that every method takes."""

    exclude: Annotated[
        list[Exclusion] | None, Field(max_length=10_000, description="Frames that the fit leaves out.")
    ] = None

    def read_parameters(self, spec: MethodSpec) -> dict[str, Any]:
        """Return the parameters that were sent, by the names of their fields in the method's `Params`."""
        sent = self.model_dump(exclude_unset=True)
        return {
            each.field: None if each.none_allowed and sent[each.name] == NONE else sent[each.name]
            for each in spec.parameters
            if each.name in sent
        }


class NewCalibration(RootModel[dict[str, Any]]):
    """How to fit a campaign: the form of its method and no parameter of another.

    What is left out takes the method's default.
    """


def read_request(body: NewCalibration, spec: MethodSpec) -> FitRequest:
    """Read a request by the form of the campaign's method; name each parameter that is not one of it."""
    try:
        return FORMS[spec.name].model_validate(body.root)
    except ValidationError as error:
        found = located(error, "body")
    for each in found:
        if each["type"] == "extra_forbidden" and len(each["loc"]) == 2:
            each |= {"type": "parameter", "msg": f"is not a parameter of a {spec.name} fit"}
    raise invalid(found)


def _make_form(spec: MethodSpec) -> type[FitRequest]:
    extra: dict[str, Any] = {
        "method": (
            Literal[spec.name] | None,
            Field(default=None, description="The campaign's method; it may be left out."),
        )
    }
    if spec.reference == "panel":
        extra["panel_id"] = (
            Text | None,
            Field(default=None, description="The campaign's panel from now on."),
        )
    extra |= make_fields(each for each in spec.parameters if each.given_by == "request")
    return create_model(
        f"New{spec.name.capitalize()}Calibration",
        __base__=FitRequest,
        __doc__=f"How to fit a {spec.label.lower()} campaign.",
        **extra,
    )


def describe_parameter(parameter: Parameter) -> str:
    """Return the sentence of a parameter with its unit and what holds if it is left out."""
    default = parameter.default_text or parameter.default_shown
    unit = f" Unit: {parameter.unit}." if parameter.unit != "1" else ""
    return f"{parameter.description}{unit} Default: {default}."


def make_fields(parameters: Iterable[Parameter]) -> dict[str, tuple[Any, Any]]:
    """Return the fields of a form by the parameters' names; each may be left out."""
    return {
        each.name: (read_kind(each) | None, Field(default=None, description=describe_parameter(each)))
        for each in parameters
    }


def read_kind(parameter: Parameter) -> Any:  # noqa: ANN401  a type, or a form of one
    kind: Any = Text
    if parameter.kind == "choice":
        kind = _annotate(
            Literal[tuple(choice.value for choice in parameter.choices)], BeforeValidator(_refuse_truth)
        )
    elif parameter.kind == "boolean":
        kind = _annotate(bool, Strict())
    elif parameter.kind == "group":
        members: dict[str, Any] = make_fields(parameter.members)
        name = "".join(word.capitalize() for word in parameter.label.split())
        kind = create_model(name, __base__=Form, __doc__=parameter.description, **members)
    elif parameter.kind == "interval":
        kind = _annotate(list[_bound(parameter)], Field(min_length=2, max_length=2))  # type: ignore[misc]
    elif parameter.none_allowed:
        kind = _annotate(
            _annotate(_bound(parameter), Tag(AS_NUMBER)) | _annotate(Literal["none"], Tag(BY_NAME)),
            Discriminator(lambda value: BY_NAME if isinstance(value, str) else AS_NUMBER),
        )
    elif parameter.kind in ("number", "integer"):
        kind = _bound(parameter)
    elif parameter.kind == "text":
        kind = CurveText
    return kind


def _bound(parameter: Parameter) -> Any:  # noqa: ANN401  a type
    low, high = parameter.minimum, parameter.maximum
    limits: dict[str, Any] = {
        "gt" if parameter.above_minimum else "ge": low,
        "lt" if parameter.below_maximum else "le": high,
    }
    given = {name: limit for name, limit in limits.items() if limit is not None}
    if parameter.kind == "integer":
        return _annotate(int, Strict(), Field(**given), WHOLE)
    return _annotate(float, Strict(), Field(**given))


def _refuse_truth(value: Any) -> Any:  # noqa: ANN401  whatever JSON holds
    """Refuse true and false, which Python takes for 1 and 0."""
    if isinstance(value, bool):
        raise PydanticCustomError("choice", "must be one of the choices, neither true nor false")
    return value


def _annotate(kind: Any, *metadata: Any) -> Any:  # noqa: ANN401  a type
    return Annotated[(kind, *metadata)]


FORMS = {spec.name: _make_form(spec) for spec in methods.METHODS}


def describe_requests() -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the schemas of the methods' forms and their parts by name, and the schema of any of them."""
    _, document = models_json_schema(
        [(form, "validation") for form in FORMS.values()], ref_template="#/components/schemas/{model}"
    )
    body = {
        "title": NewCalibration.__name__,
        "description": NewCalibration.__doc__,
        "anyOf": [{"$ref": f"#/components/schemas/{form.__name__}"} for form in FORMS.values()],
    }
    return document["$defs"], body
