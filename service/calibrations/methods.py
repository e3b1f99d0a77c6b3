"""The calibration methods: what each takes and reports, and what its findings mean."""

import hashlib
from collections.abc import Iterable
from dataclasses import asdict, fields
from typing import Any

from fastapi import Request, Response
from pydantic import Field, TypeAdapter

from radiometry.findings import Finding
from radiometry.methods import METHODS
from radiometry.methods.findings import FINDINGS
from radiometry.specification import application, certificate, method
from radiometry.specification.parameters import Choice, Kind, Parameter
from radiometry.specification.roles import Grid, Role
from service.calibrations.fits import FitRequest
from service.http import answers, auth, models, operations
from store.codec import drop_absent

Node = dict[str, Any]


class ChoiceAnswer(models.Answer, restates=Choice):
    """One of the values that a parameter may have."""


class ParameterAnswer(models.Answer, restates=Parameter, without="kind suggest displaced_by"):
    """One parameter of a fit."""

    type: Kind
    above_minimum: bool = Field(description="Whether the value must lie above the minimum, not at it.")
    default: Any = Field(default=None, description="Left out where there is none; see default_text.")
    default_text: str = Field(description="What the fit does without it, if it has no default.")
    example: Any = Field(default=None, description="A value that could be given, where there is no default.")
    suggestions: list[str] = Field(description="Of a text: names that it may have.")
    members: list["ParameterAnswer"] = Field(description="Of a group: its parameters.")

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
    roles: list[RoleAnswer] = Field(description="The first is the role of a frame for which none is given.")
    needs_target: bool = Field(description="Whether the campaign describes what is photographed.")
    target_example: dict[str, Any] | None = None
    target_fields: list[str] = Field(description="Names of the fields of the campaign's target.")
    measured_quantity: str | None = Field(
        default=None, description="What a version measures in a region of a later frame."
    )
    measurement_options: list[str] = Field(description="Options of a measurement beside region and products.")
    conditions: list[ParameterAnswer] = Field(
        description="Of these options the surroundings of a measurement."
    )
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
            grid=MethodGridAnswer.restate(spec.grid),
            parameters=[ParameterAnswer.of(each) for each in spec.parameters],
        )


class MethodsAnswer(models.Answer):
    """Every method that this service knows."""

    items: list[MethodAnswer]


def describe_methods() -> MethodsAnswer:
    return MethodsAnswer(items=[MethodAnswer.of(spec) for spec in METHODS])


def describe_versions() -> tuple[dict[str, Node], dict[str, Node]]:
    """Return the schemas of what versions hold, by name, and those of their properties of each method."""
    schemas: dict[str, Node] = {}
    properties: dict[str, list[Node]] = {"parameters": [], "diagnostics": [], "points": []}
    for spec in METHODS:
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


class FindingAnswer(models.Answer, restates=Finding):
    """A finding that can occur in a frame, a fit or a measurement."""


class FindingsAnswer(models.Answer):
    """Every finding that this service knows."""

    items: list[FindingAnswer]


def describe_findings() -> FindingsAnswer:
    return FindingsAnswer(items=[FindingAnswer.model_validate(asdict(each)) for each in FINDINGS.values()])


findings_router = operations.Router(prefix="/v1/findings", tags=["calibrations"])


@findings_router.get("", response_model=FindingsAnswer)
def list_findings(request: Request, _caller: auth.Reader) -> Response:
    """List the findings with severity, place, sentence and remedy.

    Flags, reasons of verdicts and refusals name a `code` of this list. It changes only with the release.
    """
    answer = describe_findings()
    tag = hashlib.sha256(answer.model_dump_json().encode()).hexdigest()
    headers = answers.standing_headers(tag)
    return answers.not_modified(request, tag, headers) or answer.respond(headers)
