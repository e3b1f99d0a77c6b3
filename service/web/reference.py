"""The OpenAPI document as a page to read."""

import json
from collections.abc import Iterator
from html import escape
from typing import Any

from service.document import ALSO_ACCEPTS, resolve

Node = dict[str, Any]


def render_reference(document: Node) -> str:
    """Every route under its resource: what it does, what it takes, and an example of each answer."""
    return "".join(_lines(document))


def _lines(document: Node) -> Iterator[str]:
    info = document["info"]
    yield f"<h1>{escape(info['title'])} API, version {escape(info['version'])}</h1>"
    yield f"<p>{escape(info['summary'])}</p>"
    yield (
        "<p>Send your key with each request: <code>Authorization: Bearer &lt;key&gt;</code>. "
        'Machines read <a href="/openapi.json">/openapi.json</a>; '
        'what an error means stands in <a href="/docs/errors">/docs/errors</a>.</p>'
    )
    tag = None
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            if operation["tags"][0] != tag:
                tag = operation["tags"][0]
                yield f"<h2>{escape(tag.capitalize())}</h2>"
            yield from _operation(document, method.upper(), path, operation)


def _operation(document: Node, method: str, path: str, operation: Node) -> Iterator[str]:
    name = escape(operation["operationId"])
    yield f'<details id="{name}"><summary><code>{method} {escape(path)}</code> '
    yield f"{escape(operation['summary'])}</summary><p>{escape(operation['description'])}</p>"
    yield from _parameters(operation.get("parameters", []))
    body = operation.get("requestBody", {})
    for kind, media in {**body.get("content", {}), **body.get(ALSO_ACCEPTS, {})}.items():
        yield f"<h3>Send {escape(kind)}</h3>{_sample(media)}"
    for status, named in operation["responses"].items():
        answer = resolve(document, named)
        yield f"<h3>{status} {escape(answer['description'])}</h3>"
        if int(status) < 400:
            for kind, media in answer.get("content", {}).items():
                yield f"<p>{escape(kind)}</p>{_sample(media)}"
    yield "</details>"


def _parameters(parameters: list[Node]) -> Iterator[str]:
    if parameters:
        yield "<table><tr><th>Parameter</th><th>In</th><th>Type</th><th></th></tr>"
        for each in parameters:
            needed = "" if each.get("required") else "optional. "
            cells = (each["name"], each["in"], _type(each["schema"]), needed + each.get("description", ""))
            yield f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in cells)}</tr>"
        yield "</table>"


def _type(schema: Node) -> str:
    if "enum" in schema or "const" in schema:
        return " | ".join(schema.get("enum", [schema.get("const")]))
    return str(schema.get("format") or schema.get("type") or "")


def _sample(media: Node) -> str:
    example = media.get("example")
    if example is None:
        return ""
    text = example if isinstance(example, str) else json.dumps(example, indent=2)
    return f"<pre>{escape(text)}</pre>"
