"""A frame's picture for a list: small, with the region drawn on it."""

import hashlib
import io
from collections.abc import Iterable, Sequence
from typing import Final

from PIL import Image, ImageDraw

from store.tables import Roi

WIDEST_PX: Final = 320
_MOST_BYTES: Final = 40_000
_GREYS: Final = (63, 31, 15, 7, 3)
"""Grey levels that are tried; the region's colour stands behind the last of them."""
_QUALITIES: Final = (60, 30, 10, 1)
_REGION: Final = (255, 120, 0)
_DRAWING: Final = "2"  # of the pictures' tags: counts up when the same frame is drawn differently

_Outlines = Sequence[Sequence[tuple[float, float]]]


def tag_of(preview_sha256: str | None, region_id: str | None) -> str | None:
    """Return what changes when the picture does; None while there is none."""
    if preview_sha256 is None:
        return None
    return hashlib.sha256(f"{_DRAWING} {preview_sha256} {region_id}".encode()).hexdigest()[:8]


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
    grey, outlines = _reduce(preview, frame_width_px, roi, side_px)
    return _take_small(_encode_greys(grey, levels, outlines) for levels in _GREYS)


def draw_light_thumbnail(small_preview: bytes, frame_width_px: int, roi: Roi | None) -> bytes:
    """Draw a small preview with the region as WebP, at most 40 kB: a fifth of the PNG, for many at once."""
    grey, outlines = _reduce(small_preview, frame_width_px, roi, WIDEST_PX)
    picture = grey.convert("RGB")
    draw = ImageDraw.Draw(picture)
    for points in outlines:
        # two pixels wide: colours are kept at half the resolution
        draw.line([*points, *points[:2]], fill=_REGION, width=2)
    return _take_small(_encode_lossy(picture, quality) for quality in _QUALITIES)


def _reduce(
    preview: bytes, frame_width_px: int, roi: Roi | None, side_px: int
) -> tuple[Image.Image, _Outlines]:
    """Return the small grey picture, and the region's outlines in its pixels."""
    with Image.open(io.BytesIO(preview)) as opened:
        grey = opened.convert("L")
    grey.thumbnail((side_px, side_px), reducing_gap=2.0)
    scale = grey.width / frame_width_px
    outlines = [] if roi is None else [part["points"] for part in roi.parts or [{"points": roi.points}]]
    return grey, [[(x * scale, y * scale) for x, y in points] for points in outlines]


def _take_small(encoded: Iterable[bytes]) -> bytes:
    """Return the first that is small enough, else the last."""
    picture = b""
    for picture in encoded:
        if len(picture) <= _MOST_BYTES:
            break
    return picture


def _encode_greys(grey: Image.Image, levels: int, outlines: _Outlines) -> bytes:
    picture = grey.point([round(value * (levels - 1) / 255) for value in range(256)])
    picture.putpalette(
        [round(255 * level / (levels - 1)) for level in range(levels) for _ in "rgb"] + list(_REGION)
    )
    draw = ImageDraw.Draw(picture)
    for points in outlines:
        draw.polygon(points, outline=levels)
    out = io.BytesIO()
    picture.save(out, "PNG", optimize=True, bits=levels.bit_length())
    return out.getvalue()


def _encode_lossy(picture: Image.Image, quality: int) -> bytes:
    out = io.BytesIO()
    picture.save(out, "WEBP", quality=quality, method=2)
    return out.getvalue()
