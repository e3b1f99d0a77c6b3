"""Compare the HTTP interface with that of the last release (`make api`); `--release` freezes it for the next.

A line of docs/api.txt is one promise of the released OpenAPI document. A promise that is gone, or a field
or parameter that a request suddenly needs, breaks clients; what is only added does not.
"""

import json
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

from service.http.app import build_app
from service.http.context import Context
from store.settings import Settings

Node = dict[str, Any]

RELEASED = Path(__file__).with_name("api.txt")
DECIDED = Path(__file__).with_name("api-decided.txt")
"""Breaks of the coming release, each under a comment with its reason; empty after a release."""
_NEEDED = " must be sent"
_ERROR = 400


def list_promises(document: Node) -> set[str]:
    """Return what an OpenAPI document promises, a line each, without sentences and examples."""
    return {*_list_operations(document), *_list_fields(document)}


def _list_operations(document: Node) -> Iterator[str]:
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            name = f"{method.upper()} {path}"
            yield f"{name} is {operation['operationId']}"
            for parameter in operation.get("parameters", ()):
                yield f"{name} takes {parameter['in']} {parameter['name']}"
                if parameter.get("required") and parameter["in"] != "path":
                    yield f"{name} {parameter['in']} {parameter['name']}{_NEEDED}"
            body = operation.get("requestBody", {})
            for kind, media in body.get("content", {}).items():
                yield f"{name} takes {kind} {_name_type(media.get('schema', {}))}"
            for status, answer in operation["responses"].items():
                if int(status) >= _ERROR:
                    continue
                yield f"{name} answers {status}"
                for kind, media in answer.get("content", {}).items():
                    yield f"{name} answers {status} {kind} {_name_type(media.get('schema', {}))}"


def _list_fields(document: Node) -> Iterator[str]:
    for name, schema in document["components"]["schemas"].items():
        required = set(schema.get("required", ()))
        is_form = schema.get("additionalProperties") is False
        for field, kind in schema.get("properties", {}).items():
            yield f"{name}.{field}"
            yield from (f"{name}.{field} may be {_name_type(each)}" for each in _list_types(kind))
            if field in required:
                yield f"{name}.{field}{_NEEDED if is_form else ' is always there'}"


def _list_types(kind: Node) -> list[Node]:
    """Return the alternatives of a type, each value of an enumeration for itself."""
    if "enum" in kind:
        return [{"const": value} for value in kind["enum"]]
    return [one for each in kind.get("anyOf", kind.get("oneOf", ())) for one in _list_types(each)] or [kind]


def _name_type(kind: Node) -> str:
    if "$ref" in kind:
        return str(kind["$ref"]).rpartition("/")[2]
    if "const" in kind:
        return json.dumps(kind["const"])
    if kind.get("type") == "array":
        return f"[{' | '.join(sorted(map(_name_type, _list_types(kind.get('items', {})))))}]"
    alternatives = _list_types(kind)
    if alternatives != [kind]:
        return " | ".join(sorted(map(_name_type, alternatives)))
    return str(kind.get("type", "anything"))


def find_breaks(released: set[str], now: set[str]) -> list[str]:
    """Return each difference that a client of the release may fail on."""
    widened = {line.removesuffix(" may be string") for line in now if line.endswith(" may be string")}
    gone = {
        line
        for line in released - now
        if not line.endswith(_NEEDED)
        and not (line.endswith('"') and line.partition(" may be ")[0] in widened)
    }
    holders = {_name_holder(line) for line in released}
    needed = {line for line in now - released if line.endswith(_NEEDED)}
    return sorted(
        [f"- {line}" for line in gone] + [f"+ {line}" for line in needed if _name_holder(line) in holders]
    )


def _name_holder(line: str) -> str:
    return " ".join(line.split()[:2]) if "/" in line else line.partition(".")[0]


def read_lines(path: Path) -> set[str]:
    """Return the lines of a file that are not comments."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return {line for line in lines if line and not line.startswith("#")}


def build_current() -> Node:
    """Return the document that this code serves; no database is asked for it."""
    with tempfile.TemporaryDirectory() as folder:
        context = SimpleNamespace(settings=Settings(data=Path(folder)))
        return build_app(cast("Context", context)).openapi()


def main(*, release: bool) -> int:
    """Print the difference, breaks first; 1 if one was not decided. With `release`, freeze what is."""
    now = list_promises(build_current())
    if release:
        DECIDED.write_text("", encoding="utf-8")
        RELEASED.write_text("".join(f"{line}\n" for line in sorted(now)), encoding="utf-8")
        return 0
    released, decided = read_lines(RELEASED), read_lines(DECIDED)
    breaks = find_breaks(released, now)
    added = sorted(f"+ {line}" for line in now - released)
    shown = [f"{line}{'   (decided)' if line in decided else '   BREAKS CLIENTS'}" for line in breaks]
    sys.stdout.write(
        "".join(f"{line}\n" for line in [*shown, *(line for line in added if line not in breaks)])
    )
    return 1 if set(breaks) - decided else 0


if __name__ == "__main__":
    sys.exit(main(release="--release" in sys.argv))
