"""A frame's map in one pass: read, computed, written and reduced band by band."""

import itertools
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Self

import numpy as np

from radiometry.frame import Frame, FrameHeader
from worker.decode.pool import DecoderPool, Readable
from worker.maps.picture import Part, Reduction, Style, draw_picture
from worker.maps.tiff import TILE_PX, MapFacts, Plane, encode_band, write_tiff

_STRIP_PX = 1 << 21
_AHEAD = 2


def cut_strips(header: FrameHeader) -> list[tuple[int, int]]:
    """First row and height of each strip: whole bands of the file's tiles, so that none is decoded twice."""
    bands = max(1, round(_STRIP_PX / (header.width_px * header.band_rows)))
    step = bands * header.band_rows
    ends = range(header.first_band_rows + step - header.band_rows, header.height_px, step)
    edges = [0, *ends, header.height_px]
    return [(top, bottom - top) for top, bottom in itertools.pairwise(edges)]


class StripReader:
    """Reader of rows from the top downwards; one process reads the next two strips meanwhile."""

    def __init__(self, decoders: DecoderPool, file: Readable, header: FrameHeader) -> None:
        self._decoders, self._file = decoders, file
        self._width = header.width_px
        self._ahead = ThreadPoolExecutor(1, thread_name_prefix="strips")
        self._left = iter(cut_strips(header))
        self._coming: deque[Future[Frame]] = deque()
        self._held: list[Frame] = []

    def __enter__(self) -> Self:
        for _ in range(_AHEAD):
            self._fetch()
        return self

    def __exit__(self, *_: object) -> None:
        self._ahead.shutdown(cancel_futures=True)

    def rows(self, first: int, last: int) -> Frame:
        """Rows [first, last) of the frame; what lies above them is forgotten."""
        self._held = [frame for frame in self._held if _end(frame) > first]
        while not self._held or _end(self._held[-1]) < last:
            self._held.append(self._coming.popleft().result())
            self._fetch()
        parts = [
            frame.samples_dn[max(0, first - frame.row0) : last - frame.row0]
            for frame in self._held
            if frame.row0 < last
        ]
        samples = parts[0] if len(parts) == 1 else np.concatenate(parts)
        return replace(self._held[0], samples_dn=samples, row0=first)

    def _fetch(self) -> None:
        if (strip := next(self._left, None)) is not None:
            window = (strip[0], 0, strip[1], self._width)
            self._coming.append(self._ahead.submit(self._decoders.read_window, self._file, window))


def _end(frame: Frame) -> int:
    return int(frame.row0 + frame.samples_dn.shape[0])


def cut_bands(height_px: int, rows: int) -> Iterator[tuple[int, int]]:
    """First and last row (exclusive) of each band of a map."""
    return ((top, min(top + rows, height_px)) for top in range(0, height_px, rows))


_THREADS: Final = 2
_WAITING: Final = 4


@dataclass(frozen=True, kw_only=True)
class Subject:
    """The frame's file, and how a window of its raw numbers becomes a window of the map.

    ``rim_px`` : how far beyond a window ``compute`` must see; ``counts`` : whether pixels outside [0, 1] and
    unknown ones are counted; ``report`` : is told the share that is done
    """

    file: Readable
    header: FrameHeader
    compute: Callable[[Frame], Plane]
    rim_px: int = 0
    counts: bool = False
    report: Callable[[float], None] | None = None


@dataclass(frozen=True)
class Made:
    """A map's picture as PNG, and how many of its pixels leave [0, 1] or are unknown, if counted."""

    picture: bytes
    below_zero: int = 0
    above_one: int = 0
    unknown: int = 0


def make_map(
    decoders: DecoderPool, subject: Subject, facts: MapFacts, target: Path, *, style: Style, caption: str
) -> Made:
    return _finish(write_map(decoders, subject, facts, target), style, caption)


def _finish(reduction: Reduction, style: Style, caption: str) -> Made:
    return Made(draw_picture(reduction.means(), caption, style), *reduction.odd.tolist())


def write_map(decoders: DecoderPool, subject: Subject, facts: MapFacts, target: Path) -> Reduction:
    """Write the TIFF to ``target``; what its picture is drawn from."""
    header = subject.header
    reduction = Reduction(header.height_px, header.width_px, counts=subject.counts)
    with (
        decoders.hold(subject.file),
        StripReader(decoders, subject.file, header) as reader,
        ThreadPoolExecutor(_THREADS, thread_name_prefix="bands") as threads,
    ):
        tiles = _make_tiles(reader, subject, reduction, threads)
        first = next(tiles)  # the threads are at work before the file is opened
        write_tiff(target, itertools.chain([first], tiles), facts)
    return reduction


def draw_map(
    planes: Sequence[Plane], facts: MapFacts, target: Path, *, style: Style, caption: str, counts: bool
) -> Made:
    """Write planes that are computed already as one TIFF, and draw the first."""
    reduction = Reduction(*planes[0].shape, counts=counts)
    for top, bottom in cut_bands(len(planes[0]), TILE_PX):
        reduction.add(reduction.reduce(planes[0][top:bottom], top=top))
    with ThreadPoolExecutor(_THREADS, thread_name_prefix="bands") as threads:
        cut = [plane[top:bottom] for plane in planes for top, bottom in cut_bands(len(plane), TILE_PX)]
        write_tiff(target, itertools.chain.from_iterable(threads.map(encode_band, cut)), facts)
    return _finish(reduction, style, caption)


def average_maps(decoders: DecoderPool, subject: Subject, repeats: Iterable[Subject]) -> Subject:
    """Compute the mean of the maps of several frames, as one subject; unknown in one frame is unknown."""
    header = subject.header
    plane, count = np.zeros((header.height_px, header.width_px), np.float32), 0
    for each in itertools.chain([subject], repeats):
        count += 1
        with decoders.hold(each.file), StripReader(decoders, each.file, header) as reader:
            for top, bottom in cut_bands(header.height_px, TILE_PX):
                frame = reader.rows(max(0, top - each.rim_px), min(header.height_px, bottom + each.rim_px))
                plane[top:bottom] += each.compute(frame)[top - frame.row0 : bottom - frame.row0]
    plane /= np.float32(count)
    return replace(
        subject, rim_px=0, compute=lambda frame: plane[frame.row0 : frame.row0 + len(frame.samples_dn)]
    )


def _make_tiles(
    reader: StripReader, subject: Subject, reduction: Reduction, threads: ThreadPoolExecutor
) -> Iterator[bytes]:
    """Compressed tiles in order, a few bands at once: numpy and the compressor leave Python's lock alone."""
    height = subject.header.height_px

    def work(frame: Frame, top: int, bottom: int) -> tuple[list[bytes], Part]:
        band = subject.compute(frame)[top - frame.row0 : bottom - frame.row0]
        return encode_band(band), reduction.reduce(band, top=top)

    waiting: deque[Future[tuple[list[bytes], Part]]] = deque()
    for top, bottom in cut_bands(height, TILE_PX):
        frame = reader.rows(max(0, top - subject.rim_px), min(height, bottom + subject.rim_px))
        waiting.append(threads.submit(work, frame, top, bottom))
        if subject.report is not None:
            subject.report(bottom / height)
        if len(waiting) > _WAITING:
            yield from _collect(waiting.popleft(), reduction)
    for future in waiting:
        yield from _collect(future, reduction)


def _collect(future: "Future[tuple[list[bytes], Part]]", reduction: Reduction) -> list[bytes]:
    tiles, part = future.result()
    reduction.add(part)
    return tiles
