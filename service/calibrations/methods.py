"""The calibration methods: what each takes and reports, and what its findings mean."""

import hashlib
from collections.abc import Iterable
from dataclasses import asdict, fields
from typing import Annotated, Any, Literal

import pydantic
from fastapi import Request, Response
from pydantic import Discriminator, Field, RootModel, Strict, Tag, TypeAdapter, ValidationError, create_model
from pydantic.json_schema import models_json_schema
from pydantic_core import PydanticCustomError

from radiometry import findings, methods
from radiometry.methods.findings import FINDINGS
from radiometry.specification import application, certificate, method
from radiometry.specification.parameters import Choice, Kind, Parameter
from radiometry.specification.roles import Grid, Role
from service.http import answers, auth, models, operations
from service.http.problems import AS_NUMBER, BY_NAME, invalid, located
from store.codec import drop_absent

NONE = "none"  # switches off a parameter that has a default


class Exclusion(models.Form):
    """A frame that the fit leaves out, and why."""

    frame_id: models.Text
    reason: models.Reason


class FitRequest(models.Form):
    """Fields that every method takes."""

    exclude: list[Exclusion] | None = models.maybe("Frames that the fit leaves out.", max_length=10_000)

    def read_parameters(self, spec: method.MethodSpec) -> dict[str, Any]:
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


def read_request(body: NewCalibration, spec: method.MethodSpec) -> FitRequest:
    """Read a request by the form of the campaign's method; name each parameter that is not one of it."""
    try:
        return FORMS[spec.name].model_validate(body.root)
    except ValidationError as error:
        found = located(error, "body")
    for each in found:
        if each["type"] == "extra_forbidden" and len(each["loc"]) == 2:
            each |= {"type": "parameter", "msg": f"is not a parameter of a {spec.name} fit"}
    raise invalid(found)


def _make_form(spec: method.MethodSpec) -> type[FitRequest]:
    extra: dict[str, Any] = {
        "method": (Literal[spec.name] | None, models.maybe("The campaign's method; it may be left out."))
    }
    if spec.reference == "panel":
        extra["panel_id"] = (models.Text | None, models.maybe("The campaign's panel from now on."))
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
    return {
        each.name: (read_kind(each) | None, models.maybe(describe_parameter(each))) for each in parameters
    }


def read_kind(parameter: Parameter) -> Any:  # noqa: ANN401  a type, or a form of one
    kind: Any = models.Text
    if parameter.kind == "choice":
        kind = _annotate(
            Literal[tuple(choice.value for choice in parameter.choices)],
            pydantic.BeforeValidator(_refuse_truth),
        )
    elif parameter.kind == "boolean":
        kind = _annotate(bool, Strict())
    elif parameter.kind == "group":
        members: dict[str, Any] = make_fields(parameter.members)
        name = "".join(word.capitalize() for word in parameter.label.split())
        kind = create_model(name, __base__=models.Form, __doc__=parameter.description, **members)
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
        kind = models.CurveText
    return kind


def _bound(parameter: Parameter) -> Any:  # noqa: ANN401  a type
    low, high = parameter.minimum, parameter.maximum
    limits: dict[str, Any] = {
        "gt" if parameter.above_minimum else "ge": low,
        "lt" if parameter.below_maximum else "le": high,
    }
    given = {name: limit for name, limit in limits.items() if limit is not None}
    if parameter.kind == "integer":
        return _annotate(int, Strict(), Field(**given), models.WHOLE)
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
    _, document = models_json_schema(
        [(form, "validation") for form in FORMS.values()], ref_template="#/components/schemas/{model}"
    )
    body = {
        "title": NewCalibration.__name__,
        "description": NewCalibration.__doc__,
        "anyOf": [{"$ref": f"#/components/schemas/{form.__name__}"} for form in FORMS.values()],
    }
    return document["$defs"], body


Node = dict[str, Any]


class ChoiceAnswer(models.Answer, restates=Choice):
    """One of the values that a parameter may have."""


class ParameterAnswer(models.Answer, restates=Parameter, without="kind suggest displaced_by"):
    """One parameter of a fit."""

    type: Kind
    above_minimum: bool = models.told("Whether the value must lie above the minimum, not at it.")
    default: Any = models.maybe("Left out where there is none; see default_text.")
    default_text: str = models.told("What the fit does without it, if it has no default.")
    example: Any = models.maybe("A value that could be given, where there is no default.")
    suggestions: list[str] = models.told("Of a text: names that it may have.")
    members: list["ParameterAnswer"] = models.told("Of a group: its parameters.")

    @classmethod
    def of(cls, parameter: Parameter) -> "ParameterAnswer":
        members = [cls.of(each) for each in parameter.members]
        return cls.restate(
            parameter, type=parameter.kind, members=members, suggestions=list(parameter.suggest())
        )


class RoleAnswer(models.Answer, restates=Role):
    """A role that frames of a campaign may have."""

    name: models.FrameRole
    used_in_fit: bool


class CoefficientKindAnswer(models.Answer, restates=certificate.CoefficientKind, without="effect"):
    """A coefficient that the method reports."""


class MethodGridAnswer(models.Answer, restates=Grid):
    """Axes of the grid in which a campaign's frames are shown."""


class MethodAnswer(
    models.Answer,
    restates=method.MethodSpec,
    fields="label description reference has_checklist whole_frame finds_region several_regions "
    "tolerance_unit",
):
    """A calibration method."""

    name: models.Method
    roles: list[RoleAnswer] = models.told("The first is the role of a frame for which none is given.")
    needs_target: bool = models.told("Whether the campaign describes what is photographed.")
    target_example: dict[str, Any] | None = None
    target_fields: list[str] = models.told("Names of the fields of the campaign's target.")
    measured_quantity: str | None = models.maybe("What a version measures in a region of a later frame.")
    measurement_options: list[str] = models.told("Options of a measurement beside region and products.")
    conditions: list[ParameterAnswer] = models.told("Of these options the surroundings of a measurement.")
    grid: MethodGridAnswer
    parameters: list[ParameterAnswer]
    coefficients: list[CoefficientKindAnswer]

    @classmethod
    def of(cls, spec: method.MethodSpec) -> "MethodAnswer":
        roles = [(role, True) for role in spec.roles] + [(role, False) for role in spec.applied_roles]
        measured = None if isinstance(spec.application, application.PictureApplication) else spec.application
        return cls.restate(
            spec,
            roles=[RoleAnswer(**asdict(role), used_in_fit=used) for role, used in roles],
            needs_target=spec.target is not None,
            target_example=dict(spec.target_example) if spec.target_example else None,
            target_fields=[each.name for each in fields(spec.target)] if spec.target else [],
            measured_quantity=measured.quantity if measured else None,
            measurement_options=list(spec.measurement_options) if measured else [],
            conditions=[ParameterAnswer.of(each) for each in spec.conditions],
            parameters=[ParameterAnswer.of(each) for each in spec.parameters],
        )


class MethodsAnswer(models.Answer):
    """Every method that this service knows."""

    items: list[MethodAnswer]


def describe_methods() -> MethodsAnswer:
    return MethodsAnswer(items=[MethodAnswer.of(spec) for spec in methods.METHODS])


def describe_versions() -> tuple[dict[str, Node], dict[str, Node]]:
    """Return the schemas of what versions hold, by name, and those of their properties of each method."""
    schemas: dict[str, Node] = {}
    properties: dict[str, list[Node]] = {"parameters": [], "diagnostics": [], "points": []}
    for spec in methods.METHODS:
        stem = spec.name.capitalize()
        for name, kind in (("parameters", spec.params), ("diagnostics", spec.result)):
            schema = _describe(kind, stem, schemas)
            if kind is spec.result:
                points = schemas[schema]["properties"].pop("points")
                schemas[schema]["required"].remove("points")
                properties["points"].append(points["items"])
                point = schemas[points["items"]["$ref"].rpartition("/")[2]]
                point["properties"]["frame_id"] = {"type": "string"}
            properties[name].append({"$ref": f"#/components/schemas/{schema}"})
        held = schemas[f"{stem}{spec.params.__name__}"]["properties"]
        held["exclude"]["description"] = FitRequest.model_fields["exclude"].description
        _add_sentences(schemas, held, spec.parameters)
    any_of: dict[str, Node] = {name: {"anyOf": each} for name, each in properties.items()}
    return schemas, any_of | {"points": {"type": "array", "items": any_of["points"]}}


def _add_sentences(schemas: dict[str, Node], held: Node, parameters: Iterable[Parameter]) -> None:
    for parameter in parameters:
        field = held[parameter.field]
        field["description"] = parameter.description
        for each in (field, *field.get("anyOf", ())):
            if parameter.members and "$ref" in each:
                members = schemas[each["$ref"].rpartition("/")[2]]["properties"]
                _add_sentences(schemas, members, parameter.members)


def _describe(kind: type[Any], stem: str, schemas: dict[str, Node]) -> str:
    """Add the schemas of a dataclass and of what it is made of, and return its name."""
    template = f"#/components/schemas/{stem}{{model}}"
    schema = TypeAdapter(kind).json_schema(mode="serialization", ref_template=template)
    parts = schema.pop("$defs", {}) | {kind.__name__: schema}
    for name, part in parts.items():
        part["title"] = f"{stem}{name}"
        _let_absent(part)
        schemas[f"{stem}{name}"] = drop_absent(part)
    return f"{stem}{kind.__name__}"


def _let_absent(schema: Node) -> None:
    """Leave out of an answer what may be null, so that no client may require it."""
    optional = {
        name
        for name, each in schema.get("properties", {}).items()
        if {"type": "null"} in each.get("anyOf", ())
    }
    schema["required"] = [name for name in schema.get("required", ()) if name not in optional]


router = operations.Router(prefix="/v1/methods", tags=["calibrations"])


@router.get("", response_model=MethodsAnswer)
def list_methods(_caller: auth.Reader) -> Response:
    """List the calibration methods with their roles, parameters and coefficients.

    The forms of the pages and of the command line are made from this answer.
    """
    return describe_methods().respond()


class FindingAnswer(models.Answer, restates=findings.Finding):
    """A finding that can occur in a frame, a fit or a measurement."""


class FindingsAnswer(models.Answer):
    """Every finding that this service knows."""

    items: list[FindingAnswer]


findings_router = operations.Router(prefix="/v1/findings", tags=["calibrations"])


@findings_router.get("", response_model=FindingsAnswer)
def list_findings(request: Request, _caller: auth.Reader) -> Response:
    """List the findings with severity, place, sentence and remedy.

    Flags, reasons of verdicts and refusals name a `code` of this list. It changes only with the release.
    """
    answer = FindingsAnswer(items=[FindingAnswer.model_validate(asdict(each)) for each in FINDINGS.values()])
    tag = hashlib.sha256(answer.model_dump_json().encode()).hexdigest()
    return answer.respond(answers.standing(request, tag))
