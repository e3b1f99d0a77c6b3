"""The OpenAPI document, made true: what FastAPI derives, and what it cannot know."""

from collections.abc import Iterator
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi

from service.problems import HttpCode, problem_body
from service.routes import problems
from service.schemas.fits import NewCalibration, describe_requests
from service.schemas.methods import MethodsAnswer, describe_methods, describe_versions

_EXAMPLE_CODES = {
    400: HttpCode.BAD_REQUEST,
    401: HttpCode.UNAUTHENTICATED,
    403: HttpCode.SCOPE_MISSING,
    404: HttpCode.NOT_FOUND,
    409: HttpCode.CALIBRATION_REVOKED,
    413: HttpCode.UPLOAD_TOO_LARGE,
    422: HttpCode.VALIDATION_FAILED,
    500: HttpCode.STORED_FILE_DAMAGED,
    429: HttpCode.TOO_MANY_REQUESTS,
    503: HttpCode.DATABASE_UNAVAILABLE,
    507: HttpCode.STORAGE_FULL,
}
_PROBLEM = "application/problem+json"

Node = dict[str, Any]


def build_document(app: FastAPI) -> Node:
    """What the service publishes at /openapi.json; built once."""
    if app.openapi_schema is None:
        document = get_openapi(title=app.title, version=app.version, summary=app.summary, routes=app.routes)
        _add_methods(document)
        for operation in operations(document):
            _summarise(operation)
            _add_body_problems(operation)
            _show_problems(operation)
            _show_examples(document, operation)
        for name in ("HTTPValidationError", "ValidationError"):
            document["components"]["schemas"].pop(name, None)
        _absent_is_not_null(document)
        app.openapi_schema = document
    return app.openapi_schema


def _add_methods(document: Node) -> None:
    """State what each method takes and stores, where a route only knows that it is an object."""
    schemas = document["components"]["schemas"]
    forms, body = describe_requests()
    held, properties = describe_versions()
    schemas.update({**forms, **held, NewCalibration.__name__: body})
    schemas[MethodsAnswer.__name__]["examples"] = [describe_methods().dump()]
    for answer in schemas.values():
        if {"diagnostics", "points"} <= answer.get("properties", {}).keys():
            answer["properties"] |= properties


def operations(document: Node) -> Iterator[Node]:
    return (operation for path in document["paths"].values() for operation in path.values())


def resolve(document: Node, schema: Node) -> Node:
    """The schema itself, where it is named only."""
    while "$ref" in schema:
        schema = document["components"]["schemas"][schema["$ref"].rpartition("/")[2]]
    return schema


def _summarise(operation: Node) -> None:
    """The first sentence of what a route says of itself."""
    operation["summary"] = operation["description"].partition("\n")[0].partition(". ")[0].rstrip(".")


def _add_body_problems(operation: Node) -> None:
    """Any body may be unreadable or too large."""
    if "requestBody" in operation:
        for status in (400, 413):
            operation["responses"].setdefault(str(status), problems(status)[status])
            operation["responses"][str(status)].pop("model", None)


def _show_problems(operation: Node) -> None:
    """A problem is problem+json and nothing else, and its example is one of its status."""
    for status, answer in operation["responses"].items():
        if _PROBLEM in answer.get("content", {}):
            code = _EXAMPLE_CODES[int(status)]
            example = problem_body(
                int(status), code, answer["description"], retryable=int(status) == 429 or int(status) > 500
            )
            schema = {"$ref": "#/components/schemas/ProblemAnswer"}
            answer["content"] = {_PROBLEM: {"schema": schema, "example": example}}


def _show_examples(document: Node, operation: Node) -> None:
    """The example of a body stands beside it, taken from the schema that names it."""
    for holder in (operation.get("requestBody", {}), *operation["responses"].values()):
        media = holder.get("content", {}).get("application/json")
        if media is not None and "example" not in media:
            media["example"] = _example(document, media["schema"])


def _example(document: Node, schema: Node) -> Any:  # noqa: ANN401
    schema = resolve(document, schema)
    for alternative in (*schema.get("oneOf", ()), *schema.get("anyOf", ())):
        if "examples" not in schema:
            return _example(document, alternative)
    return schema["examples"][0]


def _absent_is_not_null(node: Any) -> None:  # noqa: ANN401
    """Say of an optional field what it holds when it is there: null is never sent, and never taken."""
    if isinstance(node, list):
        for member in node:
            _absent_is_not_null(member)
    if not isinstance(node, dict):
        return
    options = node.get("anyOf", [])
    kept = [option for option in options if option != {"type": "null"}]
    if len(kept) < len(options) and not node.pop("nullable_on_purpose", False):
        if len(kept) == 1:
            del node["anyOf"]
            node.update({**kept[0], **node})
        else:
            node["anyOf"] = kept
        if node.get("default", "") is None:
            del node["default"]
    for member in node.values():
        _absent_is_not_null(member)
