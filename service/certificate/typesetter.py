"""A process that sets one document with Typst and ends: what Typst keeps in memory ends with it.

It is run as a script, so that it imports nothing but Typst: JSON comes in, the PDF goes out. Nothing is
read from the machine: no fonts but those that Typst brings along, no packages, no clock.
"""

import json
import os
import sys
from pathlib import Path
from typing import Any, Final, Literal

import typst

_TEMPLATES: Final = Path(__file__).parent
_STANDARD: Final = "a-3b"  # what archives keep, and may carry its data


def main() -> None:
    os.nice(10)  # a look-up goes first
    request = json.load(sys.stdin.buffer)
    try:
        pdf = _set(request, _STANDARD)
    except typst.TypstError:
        # a name in a script that the fonts lack: the archive's standard refuses it, a plain PDF shows a box
        pdf = _set(request, None)
    sys.stdout.buffer.write(pdf)


def _set(request: dict[str, Any], standard: Literal["a-3b"] | None) -> bytes:
    # a compiler that has failed does not find its template again
    compiler = typst.Compiler(
        (_TEMPLATES / request["template"]).read_bytes(),
        font_paths=typst.Fonts(include_system_fonts=False),
        ignore_system_fonts=True,
        sys_inputs={"certificate": request["sheets"]},
    )
    pdf = compiler.compile(format="pdf", pdf_standards=standard, timestamp=request["timestamp"])
    assert isinstance(pdf, bytes)  # noqa: S101  narrows the type: one document was asked for
    return pdf


if __name__ == "__main__":
    main()
