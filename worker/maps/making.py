"""A frame's map in one pass: read, computed, written and reduced band by band."""

from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from radiometry.frame import Frame, FrameHeader
from radiometry.luminance.maps import RIM_PX, MapScale, compute_map
from worker.decode.pool import DecoderPool
from worker.maps.picture import Part, Reduction, draw_picture
from worker.maps.strips import StripReader, cut_bands
from worker.maps.tiff import TILE_PX, MapFacts, encode_band, write_tiff

_THREADS: Final = 2


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
    with (
        StripReader(decoders, subject.path, header) as reader,
        ThreadPoolExecutor(_THREADS, thread_name_prefix="bands") as threads,
    ):
        write_tiff(target, _make_tiles(reader, subject, reduction, threads), facts)
    return reduction


def _make_tiles(
    reader: StripReader, subject: Subject, reduction: Reduction, threads: ThreadPoolExecutor
) -> Iterator[bytes]:
    """Compressed tiles in order, a few bands at once: numpy and the compressor leave Python's lock alone."""
    height = subject.header.height_px

    def work(frame: Frame, top: int, bottom: int) -> tuple[list[bytes], Part]:
        band = compute_map(frame, subject.scale)[top - frame.row0 : bottom - frame.row0]
        return encode_band(band), reduction.reduce(band, top=top)

    waiting: deque[Future[tuple[list[bytes], Part]]] = deque()
    for top, bottom in cut_bands(height, TILE_PX):
        frame = reader.rows(max(0, top - RIM_PX), min(height, bottom + RIM_PX))
        waiting.append(threads.submit(work, frame, top, bottom))
        if len(waiting) > _THREADS:
            yield from _collect(waiting.popleft(), reduction)
    for future in waiting:
        yield from _collect(future, reduction)


def _collect(future: "Future[tuple[list[bytes], Part]]", reduction: Reduction) -> list[bytes]:
    tiles, part = future.result()
    reduction.add(part)
    return tiles
