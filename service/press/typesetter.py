"""Sheets into PDF, with Typst: the same bytes for the same content."""

import json
from datetime import datetime
from pathlib import Path
from typing import Any, Final, Literal

import typst

_TEMPLATES: Final = Path(__file__).parent
_STANDARD: Final = "a-3b"  # what archives keep, and may carry its data


def typeset(sheets: dict[str, Any]) -> bytes:
    """Set the sheets of `lay_out`, `lay_out_rig` or `lay_out_report`."""
    try:
        return _set(sheets, _STANDARD)
    except typst.TypstError:
        # a name in a script that the fonts lack: the archive's standard refuses it, a plain PDF shows a box
        return _set(sheets, None)


def _set(sheets: dict[str, Any], standard: Literal["a-3b"] | None) -> bytes:
    # a compiler that has failed does not find its template again
    compiler = typst.Compiler(
        (_TEMPLATES / sheets.get("template", "certificate.typ")).read_bytes(),
        font_paths=typst.Fonts(include_system_fonts=False),
        ignore_system_fonts=True,
        sys_inputs={"certificate": json.dumps(sheets)},
    )
    timestamp = int(datetime.fromisoformat(sheets["created_at"]).timestamp())
    pdf = compiler.compile(format="pdf", pdf_standards=standard, timestamp=timestamp)
    assert isinstance(pdf, bytes)  # noqa: S101  narrows the type: one document was asked for
    return pdf
