"""The OpenAPI document, made true: what FastAPI derives, and what it cannot know."""

import hashlib
import json
from collections.abc import Callable, Collection, Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi

from radiometry.findings import interface, shared
from service.calibrations import methods
from service.http import answers, tables
from service.http.operations import CHANGING
from service.http.problems import problem_body

_EXAMPLES = Path(__file__).with_name("examples.json")
"""What `make examples` recorded, by the name of the schema."""

_EXAMPLES_OF = {
    code.status: code
    for code in (
        *(interface.BAD_REQUEST, interface.UNAUTHENTICATED, interface.SCOPE_MISSING, interface.NOT_FOUND),
        *(shared.CALIBRATION_REVOKED, interface.PRECONDITION_FAILED, interface.UPLOAD_TOO_LARGE),
        *(interface.UPLOAD_TYPE, interface.RANGE_OUTSIDE, interface.UPLOAD_CHECKSUM_DIFFERS),
        *(interface.VALIDATION_FAILED, interface.STORED_FILE_DAMAGED, interface.TOO_MANY_REQUESTS),
        *(interface.DATABASE_UNAVAILABLE, interface.STORAGE_FULL),
    )
}
_PROBLEM = "application/problem+json"
ALSO_ACCEPTS = "x-also-accepts"
"""Media types of a request's body beside those of `content`, and as they are stated there."""
_OTHER_FORMS = {"application/json": "text/csv", "application/octet-stream": "text/csv"}

Node = dict[str, Any]

_HEADERS: dict[str, tuple[str, Callable[[str, Collection[str], str], bool]]] = {
    "Location": (
        "Address of the job.",
        lambda status, _, schema: status == "202" and schema.endswith("/JobAnswer"),
    ),
    "ETag": (
        "Send it as `If-None-Match`: 304 if nothing has changed.",
        lambda status, statuses, _: status in {"200", "304"} and "304" in statuses,
    ),
    "Retry-After": ("Seconds to wait, where that helps.", lambda status, *_: status in {"429", "503", "507"}),
    "WWW-Authenticate": ("`Bearer`", lambda status, *_: status == "401"),
}


class Document:
    """The document as it is sent: written once, when it is first asked for."""

    def __init__(self, app: FastAPI) -> None:
        self._app = app

    @cached_property
    def text(self) -> bytes:
        return json.dumps(self._app.openapi(), ensure_ascii=False, separators=(",", ":")).encode()

    @cached_property
    def tag(self) -> str:
        return hashlib.sha256(self.text).hexdigest()[:32]


def build_document(app: FastAPI) -> Node:
    """Return the document published at /openapi.json; built once."""
    if app.openapi_schema is None:
        document = get_openapi(title=app.title, version=app.version, summary=app.summary, routes=app.routes)
        document["info"]["license"] = {"name": "Apache-2.0", "identifier": "Apache-2.0"}
        # every path begins at the root of the host that the document comes from
        document["servers"] = [{"url": "/"}]
        _add_methods(document)
        recorded = json.loads(_EXAMPLES.read_text(encoding="utf-8"))
        for path in document["paths"].values():
            for method in path.keys() & {each.lower() for each in CHANGING}:
                path[method]["responses"].setdefault("412", answers.problems(412)[412])
        for operation in operations(document):
            # the first sentence of what a route says of itself
            operation["summary"] = operation["description"].partition("\n")[0].partition(". ")[0].rstrip(".")
            if "requestBody" in operation:
                for status in (400, 413, 415):
                    operation["responses"].setdefault(str(status), answers.problems(status)[status])
            _show_problems(operation)
            _register_forms(document, operation.get("requestBody", {}))
            _show_examples(document, operation, recorded)
            _set_other_forms_apart(operation)
            _state_headers(operation)
            # stated, so that it is not taken for forgotten
            operation.setdefault("security", [])
        for name in ("HTTPValidationError", "ValidationError"):
            document["components"]["schemas"].pop(name, None)
        for name, schema in document["components"]["schemas"].items():
            _set_conditions_apart(schema)
            if schema.get("title") == name:
                del schema["title"]
        _absent_is_not_null(document)
        _drop_titles(document)
        _share_problems(document)
        app.openapi_schema = document
    return app.openapi_schema


def _add_methods(document: Node) -> None:
    """State what each method takes and stores, where a route only knows that it is an object."""
    schemas = document["components"]["schemas"]
    forms, body = methods.describe_requests()
    held, properties = methods.describe_versions()
    schemas.update({**forms, **held, methods.NewCalibration.__name__: body})
    for answer in schemas.values():
        if {"diagnostics", "points"} <= answer.get("properties", {}).keys():
            answer["properties"] |= properties
    schemas["CertificateAnswer"]["properties"]["parameters"] = properties["parameters"]


def operations(document: Node) -> Iterator[Node]:
    return (operation for path in document["paths"].values() for operation in path.values())


def resolve(document: Node, node: Node) -> Node:
    """The schema or the answer itself, where it is named only."""
    while "$ref" in node:
        *_, kind, name = node["$ref"].split("/")
        node = document["components"][kind][name]
    return node


def _show_problems(operation: Node) -> None:
    """A problem is problem+json and nothing else, and its example is one of its status."""
    for status, answer in operation["responses"].items():
        if _PROBLEM in answer.get("content", {}):
            code = _EXAMPLES_OF[int(status)]
            example = problem_body(int(status), code, answer["description"], retryable=code.retryable)
            schema = {"$ref": "#/components/schemas/ProblemAnswer"}
            answer["content"] = {_PROBLEM: {"schema": schema, "example": example}}


def _show_examples(document: Node, operation: Node, recorded: Node) -> None:
    """Put a recorded body beside each schema; of a table its first rows."""
    for holder in (operation.get("requestBody", {}), *operation["responses"].values()):
        content = holder.get("content", {})
        media = content.get("application/json", {})
        if (example := _find_example(document, media.get("schema", {}), recorded)) is not None:
            media["example"] = example
            if "requestBody" in operation and "text/csv" in content:
                content["text/csv"]["example"] = tables.write_csv(example.get("rows", [example]))


def _register_forms(document: Node, node: Any) -> Any:  # noqa: ANN401
    """Move each form that a body writes out to the components: a generator names a class once."""
    if isinstance(node, list):
        return [_register_forms(document, member) for member in node]
    if not isinstance(node, dict):
        return node
    for key, member in node.items():
        node[key] = _register_forms(document, member)
    if node.get("type") != "object" or "title" not in node:
        return node
    document["components"]["schemas"].setdefault(node["title"], node)
    return {"$ref": f"#/components/schemas/{node['title']}"}


def _set_other_forms_apart(operation: Node) -> None:
    """Keep one form of a body in an extension: of two, openapi-python-client drops or sends the wrong one."""
    body = operation.get("requestBody", {})
    for kind, other in _OTHER_FORMS.items():
        if {kind, other} <= body.get("content", {}).keys():
            body[ALSO_ACCEPTS] = {other: body["content"].pop(other)}


def _set_conditions_apart(schema: Node) -> None:
    """Keep in `allOf` which fields go together: generators take alternatives for types of their own."""
    for word in ("oneOf", "anyOf"):
        if "properties" in schema and word in schema:
            schema["allOf"] = [{word: schema.pop(word)}]


def _state_headers(operation: Node) -> None:
    """State the headers that follow from an answer's status, and where a job leads to."""
    for status, answer in operation["responses"].items():
        schema = answer.get("content", {}).get("application/json", {}).get("schema", {})
        for name, (description, is_sent) in _HEADERS.items():
            if is_sent(status, operation["responses"].keys(), schema.get("$ref", "")):
                header = {"description": description, "schema": {"type": "string"}}
                answer.setdefault("headers", {})[name] = header
        if status == "202" and schema.get("$ref", "").endswith("/JobAnswer"):
            parameters = {"job_id": "$response.body#/id"}
            answer["links"] = {
                name: {"operationId": name, "parameters": parameters} for name in ("get_job", "follow_job")
            }


def _list_objects(node: Any) -> Iterator[Node]:  # noqa: ANN401
    """Yield each object of the document before those within it."""
    if isinstance(node, dict):
        yield node
    for member in node.values() if isinstance(node, dict) else node if isinstance(node, list) else ():
        yield from _list_objects(member)


def _drop_titles(document: Node) -> None:
    """Drop the titles of fields and parameters: FastAPI makes them of their names. Those of schemas stay."""
    for node in _list_objects(document):
        properties = node.get("properties", {})
        for member in (*properties.values(), node.get("schema")) if isinstance(properties, dict) else ():
            if isinstance(member, dict) and "properties" not in member:
                member.pop("title", None)


def _share_problems(document: Node) -> None:
    """Move each problem to the components, named after the code of its example: all routes have the same."""
    shared: Node = document["components"].setdefault("responses", {})
    for operation in operations(document):
        for status, answer in operation["responses"].items():
            if _PROBLEM in answer.get("content", {}):
                name = answer["content"][_PROBLEM]["example"]["code"]
                if shared.setdefault(name, answer) == answer:
                    operation["responses"][status] = {"$ref": f"#/components/responses/{name}"}


def _find_example(document: Node, schema: Node, recorded: Node) -> Any:  # noqa: ANN401
    name = schema.get("$ref", "").rpartition("/")[2] or schema.get("title", "")
    if name in recorded:
        return recorded[name]
    schema = resolve(document, schema)
    if name.startswith("Page_"):
        item = _find_example(document, schema["properties"]["items"]["items"], recorded)
        return {"items": [item], "next": None}
    alternatives = [*schema.get("oneOf", ()), *schema.get("anyOf", ())]
    return _find_example(document, alternatives[0], recorded) if alternatives else None


def _absent_is_not_null(document: Node) -> None:
    """Remove null from the types of optional fields: it is never sent and never accepted."""
    for node in _list_objects(document):
        options = node.get("anyOf", [])
        kept = [option for option in options if option != {"type": "null"}]
        if len(kept) == len(options) or node.pop("nullable_on_purpose", False):
            continue
        if len(kept) == 1:
            del node["anyOf"]
            node.update({**kept[0], **node})
        else:
            node["anyOf"] = kept
        if node.get("default", "") is None:
            del node["default"]
