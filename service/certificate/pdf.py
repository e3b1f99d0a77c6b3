"""The certificate as PDF: its sheets, set by Typst from one template, the same bytes for the same content.

Nothing is read from the machine: no fonts but those that Typst brings along, no packages, no clock.
"""

import base64
import json
from collections.abc import Sequence
from datetime import datetime
from functools import cache
from pathlib import Path
from typing import Final

import typst

from service.certificate.sheet import Node

_TEMPLATE = Path(__file__).parent / "certificate.typ"
_STANDARD: Final = "a-2b"  # what archives keep


def render_pdf(sheets: Node) -> bytes:
    """``sheets`` : everything that the template sets, of `lay_out` or `lay_out_rig`."""
    content = json.dumps(sheets)
    timestamp = int(datetime.fromisoformat(sheets["created_at"]).timestamp())
    try:
        pdf = _compiler(content).compile(format="pdf", pdf_standards=_STANDARD, timestamp=timestamp)
    except typst.TypstError:
        # a name in a script that the fonts lack: the archive's standard refuses it, a plain PDF shows a box
        pdf = _compiler(content).compile(format="pdf", timestamp=timestamp)
    assert isinstance(pdf, bytes)  # noqa: S101  narrows the type: one document was asked for
    return pdf


def _compiler(content: str) -> typst.Compiler:
    return typst.Compiler(
        _TEMPLATE.read_bytes(),
        font_paths=_fonts(),
        ignore_system_fonts=True,
        sys_inputs={"certificate": content},
    )


def draw_region(
    png: bytes, width_px: int, height_px: int, polygons: Sequence[Sequence[Sequence[float]]]
) -> str:
    """SVG of a frame's preview with the parts of its region on it, in the frame's own pixels."""
    picture = base64.b64encode(png).decode()
    stroke = max(width_px, height_px) / 300
    drawn = "".join(
        f'<polygon points="{" ".join(f"{x:g},{y:g}" for x, y in corners)}" fill="#ffd400" '
        f'fill-opacity="0.12" stroke="#ffd400" stroke-width="{stroke:.2f}"/>'
        for corners in polygons
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width_px} {height_px}">'
        f'<image href="data:image/png;base64,{picture}" width="{width_px}" height="{height_px}" '
        f'preserveAspectRatio="none"/>{drawn}</svg>'
    )


@cache
def _fonts() -> typst.Fonts:
    return typst.Fonts(include_system_fonts=False)
