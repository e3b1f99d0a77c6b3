"""The pages' static files, under addresses that change with their content and are therefore kept for ever."""

import gzip
import hashlib
import mimetypes
import posixpath
import re
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from fastapi import APIRouter, Request, Response

from service.immutable import not_modified
from service.problems import HttpCode, Problem

_OWN: Final = Path(__file__).parent / "static"
_PUBLIC: Final = "public, max-age=31536000, immutable"
_IMPORT: Final = re.compile(r'^(?:import|export|\}) .*?"(\..*?\.js)";$', re.MULTILINE)
_TEXT: Final = {".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}

router = APIRouter(include_in_schema=False)


class Assets:
    """Our own files and Bokeh's one, each known by name; nothing else in any folder can be asked for."""

    def __init__(self) -> None:
        self._own = {path.relative_to(_OWN).as_posix(): path for path in sorted(_OWN.rglob("*.*"))}
        digest = hashlib.sha256()
        for name, path in self._own.items():
            digest.update(name.encode() + b"\0" + path.read_bytes())
        self.release = digest.hexdigest()[:16]
        self.bokeh_release = f"bokeh-{version('bokeh')}"
        self._packed: dict[Path, bytes] = {}

    def url(self, name: str) -> str:
        """The address of one of our own files."""
        if name not in self._own:
            raise KeyError(name)
        return f"/static/{self.release}/{name}"

    def imported(self, name: str) -> list[str]:
        """The addresses of all that a module imports, and that those import in turn."""
        found = [name]
        for each in found:
            text = self._own[each].read_text(encoding="utf-8")
            named = (
                posixpath.normpath(posixpath.join(posixpath.dirname(each), other))
                for other in _IMPORT.findall(text)
            )
            found += dict.fromkeys(other for other in named if other not in found)
        return [self.url(each) for each in found[1:]]

    @property
    def bokeh_url(self) -> str:
        return f"/static/{self.bokeh_release}/bokeh.min.js"

    def find(self, release: str, name: str) -> Path | None:
        """The file at an address; a page of an earlier release finds what it asks for no more."""
        if release == self.release:
            return self._own.get(name)
        if (release, name) == (self.bokeh_release, "bokeh.min.js"):
            return _bokeh_folder() / name
        return None

    def packed(self, path: Path) -> bytes:
        """The file, gzipped once and kept: they are few."""
        if path not in self._packed:
            self._packed[path] = gzip.compress(path.read_bytes(), mtime=0)
        return self._packed[path]


@router.get("/static/{release}/{name:path}")
def get_asset(request: Request, release: str, name: str) -> Response:
    assets: Assets = request.app.state.assets
    path = assets.find(release, name)
    if path is None:
        raise Problem(
            404, HttpCode.NOT_FOUND, "There is no such file here. Reload the page that asks for it."
        )
    headers = {"ETag": f'"{release}-{name}"', "Cache-Control": _PUBLIC, "Vary": "Accept-Encoding"}
    unchanged = not_modified(request, f"{release}-{name}", headers)
    if unchanged is not None:
        return unchanged
    media_type = _TEXT.get(path.suffix) or mimetypes.guess_type(path.name)[0]
    if path.suffix in _TEXT and "gzip" in request.headers.get("accept-encoding", ""):
        return Response(
            assets.packed(path), headers={**headers, "Content-Encoding": "gzip"}, media_type=media_type
        )
    return Response(path.read_bytes(), headers=headers, media_type=media_type)


def _bokeh_folder() -> Path:
    # found without importing it: that takes longer than all the rest of the service
    spec = find_spec("bokeh")
    assert spec is not None and spec.origin is not None  # noqa: S101, PT018  it is a dependency
    return Path(spec.origin).parent / "server" / "static" / "js"
