"""A process that renders one order and ends: what Typst and the figures keep in memory ends with it.

It imports no web and no database, and the service none of it. The order comes in as JSON, the file goes out.
Before it looks at the order the kernel shuts it in: nothing is read from the machine, no fonts but those that
Typst brings along, no packages, no clock.
"""

import json
import os
import resource
import sys
import threading
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Any, Final, Literal

import typst
import zxingcpp  # noqa: TID253  this process alone draws codes; shut in, it could not import it later

from radiometry.methods import get_method
from service.documents import pages
from store.sandbox import Restrictions

_MEMORY_BYTES: Final = 2 << 30
_CPU_S: Final = 120
_FOLDER: Final = Path(__file__).parent
_TEMPLATES: Final = {path.name: path.read_bytes() for path in _FOLDER.glob("*.typ")}
_STANDARD: Final = "a-3b"  # what archives keep, and may carry its data


class _Local(threading.local):
    """The compiler of a thread, made when this module is imported: it looks for its folder."""

    def __init__(self) -> None:
        fonts = typst.Fonts(include_system_fonts=False)
        self.compiler = typst.Compiler(b"", _FOLDER, font_paths=fonts, ignore_system_fonts=True)


_LOCAL: Final = _Local()


def start_threads() -> None:
    """Have Typst start its threads, as long as this process may: they serve every later document."""
    _LOCAL.compiler.compile(format="pdf", timestamp=0)


def add_code(sheets: dict[str, Any]) -> dict[str, Any]:
    code = zxingcpp.create_barcode(sheets["verify"], zxingcpp.BarcodeFormat.QRCode)
    return sheets | {"code": code.to_svg()}


def typeset(sheets: dict[str, Any]) -> bytes:
    sheets = add_code(sheets) if "verify" in sheets else sheets
    try:
        return _set(sheets, _STANDARD)
    except typst.TypstError:
        # a name in a script that the fonts lack: the archive's standard refuses it, a plain PDF shows a box
        return _set(sheets, None)


def _set(sheets: dict[str, Any], standard: Literal["a-3b"] | None) -> bytes:
    pdf = _LOCAL.compiler.compile(
        _TEMPLATES[sheets.get("template", "certificate.typ")],
        format="pdf",
        sys_inputs={"certificate": json.dumps(sheets)},
        pdf_standards=standard,
        timestamp=int(datetime.fromisoformat(sheets["created_at"]).timestamp()),
    )
    assert isinstance(pdf, bytes)  # noqa: S101  narrows the type: one document was asked for
    return pdf


_RENDERERS: Final[dict[str, Callable[[dict[str, Any]], bytes]]] = {
    "certificate": lambda order: typeset(pages.lay_out(order["certificate"], order["preview"])),
    "sheets": lambda order: typeset(order["sheets"]),
    "plot": lambda order: get_method(order["method"]).draw(order["result"]).encode(),
}


def render(order: bytes) -> bytes:
    read = json.loads(order)
    return _RENDERERS[read["kind"]](read)


def main() -> None:
    if "--first" not in sys.argv:
        os.nice(10)  # a look-up goes first
    order = sys.stdin.buffer.read()
    try:
        _shut_in(require="--require" in sys.argv)
        sys.stdout.buffer.write(render(order))
    except Exception as error:  # noqa: BLE001  told to who waits: standard error leads nowhere
        sys.stdout.write(f"{type(error).__name__}: {error}")
        sys.exit(1)


def _shut_in(*, require: bool) -> None:
    if (lacks := Restrictions().shut_in(start_threads).lacks) and require:
        raise RuntimeError(f"STILB_DECODER_SANDBOX=require, and this kernel gives no {', no '.join(lacks)}.")
    # the first ends it by SIGXCPU, which says why
    resource.setrlimit(resource.RLIMIT_CPU, (_CPU_S, _CPU_S + 1))
    if sys.platform == "linux":
        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_BYTES, _MEMORY_BYTES))


if __name__ == "__main__":
    main()
