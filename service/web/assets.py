"""The pages' static files, under addresses that change with their content and are therefore kept for ever.

Three of them are made here: `specification.js`, the methods as `GET /v1/methods` answers them;
`calculators.js`, the schemas of what the calculators take and answer; and `fields.js`, the descriptions of
the fields of forms.
"""

import gzip
import hashlib
import json
import mimetypes
import posixpath
import re
from pathlib import Path
from typing import Final

from fastapi import APIRouter, Request, Response

from radiometry.findings import interface
from service.immutable import not_modified
from service.problems import Problem
from service.schemas.methods import describe_methods
from service.schemas.tools import describe_tools
from service.web.fields import describe_fields

_OWN: Final = Path(__file__).parent / "static"
_PUBLIC: Final = "public, max-age=31536000, immutable"
_IMPORT: Final = re.compile(r'^(?:import|export|\}) .*?"(\..*?\.js)";$', re.MULTILINE)
_LATER: Final = re.compile(r'await import\("(\..*?\.js)"\)')
_TEXT: Final = {".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}

router = APIRouter(include_in_schema=False)


class Assets:
    """Our own files, each known by name; nothing else in any folder can be asked for."""

    def __init__(self) -> None:
        methods = json.dumps(describe_methods().dump()["items"])
        self._own = {
            path.relative_to(_OWN).as_posix(): path.read_bytes() for path in sorted(_OWN.rglob("*.*"))
        } | {
            "specification.js": f"export const METHODS = {methods};\n".encode(),
            "fields.js": f"export const FIELDS = {json.dumps(describe_fields())};\n".encode(),
            "calculators.js": f"export const TOOLS = {json.dumps(describe_tools())};\n".encode(),
        }
        digest = hashlib.sha256()
        for name, content in self._own.items():
            digest.update(name.encode() + b"\0" + content)
        self.release = digest.hexdigest()[:16]
        self._packed: dict[str, bytes] = {}

    def url(self, name: str) -> str:
        """The address of one of our own files."""
        if name not in self._own:
            raise KeyError(name)
        return f"/static/{self.release}/{name}"

    def imported(self, name: str) -> list[str]:
        """The addresses of all that a module imports, and that those import in turn."""
        return [self.url(each) for each in self._follow([name])[1:]]

    def later(self, name: str) -> list[str]:
        """The addresses of what a module itself asks for only when it runs: its imports may never do so."""
        first = self._follow([name])
        return [self.url(each) for each in self._follow(self._named(_LATER, name)) if each not in first]

    def _follow(self, names: list[str]) -> list[str]:
        found = list(names)
        for each in found:
            found += dict.fromkeys(other for other in self._named(_IMPORT, each) if other not in found)
        return found

    def _named(self, pattern: re.Pattern[str], module: str) -> list[str]:
        """Return the modules that one names, from its own folder."""
        folder = posixpath.dirname(module)
        text = self._own[module].decode()
        return [posixpath.normpath(posixpath.join(folder, other)) for other in pattern.findall(text)]

    def find(self, release: str, name: str) -> bytes | None:
        """The file at an address; a page of an earlier release finds what it asks for no more."""
        return self._own.get(name) if release == self.release else None

    def packed(self, name: str, content: bytes) -> bytes:
        """The file, gzipped once and kept: they are few."""
        if name not in self._packed:
            self._packed[name] = gzip.compress(content, mtime=0)
        return self._packed[name]


@router.get("/static/{release}/{name:path}")
def get_asset(request: Request, release: str, name: str) -> Response:
    assets: Assets = request.app.state.assets
    content = assets.find(release, name)
    if content is None:
        raise Problem(interface.NOT_FOUND, "There is no such file here. Reload the page that asks for it.")
    headers = {"ETag": f'"{release}-{name}"', "Cache-Control": _PUBLIC, "Vary": "Accept-Encoding"}
    unchanged = not_modified(request, f"{release}-{name}", headers)
    if unchanged is not None:
        return unchanged
    suffix = posixpath.splitext(name)[1]
    media_type = _TEXT.get(suffix) or mimetypes.guess_type(name)[0]
    if suffix in _TEXT and "gzip" in request.headers.get("accept-encoding", ""):
        headers["Content-Encoding"] = "gzip"
        content = assets.packed(name, content)
    return Response(content, headers=headers, media_type=media_type)
