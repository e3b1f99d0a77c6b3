"""A process that sets one certificate with Typst and ends: what Typst keeps in memory ends with it.

It is run as a script, so that it imports nothing but Typst: JSON comes in, the PDF goes out. Nothing is
read from the machine: no fonts but those that Typst brings along, no packages, no clock.
"""

import json
import os
import sys
from pathlib import Path
from typing import Final

import typst

_TEMPLATE: Final = Path(__file__).with_name("certificate.typ")
_STANDARD: Final = "a-2b"  # what archives keep


def main() -> None:
    os.nice(10)  # a look-up goes first
    request = json.load(sys.stdin.buffer)
    compiler = typst.Compiler(
        _TEMPLATE.read_bytes(),
        font_paths=typst.Fonts(include_system_fonts=False),
        ignore_system_fonts=True,
        sys_inputs={"certificate": request["sheets"]},
    )
    timestamp = request["timestamp"]
    try:
        pdf = compiler.compile(format="pdf", pdf_standards=_STANDARD, timestamp=timestamp)
    except typst.TypstError:
        # a name in a script that the fonts lack: the archive's standard refuses it, a plain PDF shows a box
        pdf = compiler.compile(format="pdf", timestamp=timestamp)
    assert isinstance(pdf, bytes)  # noqa: S101  narrows the type: one document was asked for
    sys.stdout.buffer.write(pdf)


if __name__ == "__main__":
    main()
