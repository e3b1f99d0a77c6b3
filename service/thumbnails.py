"""A frame's picture for a list: small, with the region drawn on it."""

import hashlib
import io
from collections.abc import Sequence
from typing import Final

from PIL import Image, ImageDraw

from store.tables import FrameRow, Roi

WIDEST_PX: Final = 320
_MOST_BYTES: Final = 40_000
_GREYS: Final = (63, 31, 15, 7, 3)
"""Grey levels that are tried; the region's colour stands behind the last of them."""
_REGION: Final = (255, 120, 0)
_DRAWING: Final = "1"  # of the pictures' ETag: counts up when the same frame is drawn differently


def tag_of(frame: FrameRow, roi: Roi | None, side_px: int) -> str:
    """Return what changes when the picture does."""
    parts = (_DRAWING, str(side_px), frame.preview_sha256 or "", roi.sha256 if roi else "")
    return hashlib.sha256(" ".join(parts).encode()).hexdigest()


def draw_thumbnail(preview: bytes, frame_width_px: int, roi: Roi | None, side_px: int = WIDEST_PX) -> bytes:
    """Draw a preview of ours again, at most 320 px wide and high and 40 kB, as PNG.

    Parameters
    ----------
    preview : bytes
        The frame's grey preview.
    frame_width_px : int
        Width of the frame, in whose pixels the region is.
    roi : Roi or None
        Region to outline.
    side_px : int
        Longest side of the picture.
    """
    with Image.open(io.BytesIO(preview)) as opened:
        grey = opened.convert("L")
    grey.thumbnail((side_px, side_px))
    scale = grey.width / frame_width_px
    outlines = [] if roi is None else [part["points"] for part in roi.parts or [{"points": roi.points}]]
    return next(
        png
        for levels in _GREYS
        if len(png := _encode(grey, levels, outlines, scale)) <= _MOST_BYTES or levels == _GREYS[-1]
    )


def _encode(
    grey: Image.Image, levels: int, outlines: Sequence[Sequence[Sequence[float]]], scale: float
) -> bytes:
    picture = grey.point([round(value * (levels - 1) / 255) for value in range(256)])
    picture.putpalette(
        [round(255 * level / (levels - 1)) for level in range(levels) for _ in "rgb"] + list(_REGION)
    )
    draw = ImageDraw.Draw(picture)
    for points in outlines:
        draw.polygon([(x * scale, y * scale) for x, y in points], outline=levels)
    out = io.BytesIO()
    picture.save(out, "PNG", optimize=True, bits=levels.bit_length())
    return out.getvalue()
