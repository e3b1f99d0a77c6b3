"""A frame's map in one pass: read, computed, written and reduced band by band."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from radiometry.frame import FrameHeader
from radiometry.luminance.maps import RIM_PX, MapScale, compute_map
from worker.decode.pool import DecoderPool
from worker.maps.picture import Reduction, draw_picture
from worker.maps.strips import StripReader, cut_bands
from worker.maps.tiff import TILE_PX, MapFacts, write_tiff

Plane = NDArray[np.float32]


@dataclass(frozen=True, kw_only=True)
class Subject:
    """The frame's file and how its raw numbers become luminance."""

    path: Path
    header: FrameHeader
    scale: MapScale


def make_map(
    decoders: DecoderPool, subject: Subject, facts: MapFacts, target: Path, *, caption: str
) -> bytes:
    """Write the TIFF to ``target``; the picture as PNG."""
    return draw_picture(write_map(decoders, subject, facts, target).means(), caption)


def write_map(decoders: DecoderPool, subject: Subject, facts: MapFacts, target: Path) -> Reduction:
    """Write the TIFF to ``target``; what its picture is drawn from."""
    header = subject.header
    reduction = Reduction(header.height_px, header.width_px)
    with StripReader(decoders, subject.path, header) as reader:
        write_tiff(target, reduction.watch(_bands(reader, subject)), facts)
    return reduction


def _bands(reader: StripReader, subject: Subject) -> Iterator[Plane]:
    height = subject.header.height_px
    for top, bottom in cut_bands(height, TILE_PX):
        first, last = max(0, top - RIM_PX), min(height, bottom + RIM_PX)
        luminance = compute_map(reader.rows(first, last), subject.scale)
        yield luminance[top - first : bottom - first]
