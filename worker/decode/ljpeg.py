"""Lossless JPEG (SOF3) as DNG uses it, with the C decoders kept away from hostile headers.

libjpeg-turbo, 1.4 to 2.5 times as fast as the two other decoders of imagecodecs, fills what is missing
silently. So the header is parsed and checked here, the decoder is given a new one with the same meaning, and
afterwards the samples are counted back into bits: a scan that ended early, or went astray, does not add up.
The scan must run unbroken up to the end marker. What a damaged scan decodes to when it still adds up cannot
be told from an image: the format has no checksum.
"""

import functools
import struct
from collections.abc import Iterator
from dataclasses import dataclass

import imagecodecs
import numpy as np
from numpy.typing import NDArray

from radiometry.findings import files

_SOF3, _DHT, _EOI, _SOS, _DRI = 0xC3, 0xC4, 0xD9, 0xDA, 0xDD
_START, _END = b"\xff\xd8", b"\xff\xd9"
_OTHER_FRAMES = frozenset(range(0xC0, 0xD0)) - {_SOF3, _DHT, 0xC8, 0xCC}
_MAX_COMPONENTS = 4
# Some writers fill the scan's last words; more than this left over means the scan was misread.
_SPARE_BITS = 64
_DIFFERENCES = 1 << 16
# What a decoder reads that misses the end is always the same, and none of this process's memory.
_BEYOND = bytes(64)


class NotDecodedHereError(Exception):
    """A valid stream with a feature that LibRaw reads and this module does not."""


@dataclass(frozen=True)
class Header:
    """Statements before a scan. ``tables`` : Huffman table of each component: 16 counts, then symbols."""

    bits: int
    rows: int
    cols: int  # of one component
    tables: tuple[bytes, ...]
    predictor: int

    @property
    def components(self) -> int:
        return len(self.tables)


@dataclass(frozen=True)
class Stream:
    header: Header
    scan: memoryview
    stuffed: int  # bytes of the scan that only follow an FF
    end: int  # of the end marker, in the bytes that were parsed


def decode(data: bytes, *, samples: int) -> tuple[NDArray[np.uint16], int]:
    """The stream's samples in the order they were written, exactly ``samples``; and the bytes it took."""
    stream = parse(data)
    header = stream.header
    claimed = header.rows * header.cols * header.components
    if claimed != samples:
        message = f"A piece of the image holds {claimed} samples where {samples} belong."
        raise files.SIZE_MISMATCH.refuse(message)
    try:
        decoded = np.asarray(
            imagecodecs.jpeg8_decode(b"".join((rebuild(header), stream.scan, _END, _BEYOND)))
        )
    except (RuntimeError, ValueError) as error:
        raise files.TRUNCATED.refuse("A piece of the image cannot be decompressed to its end.") from error
    if decoded.size != samples:
        raise files.SIZE_MISMATCH.refuse("A piece of the image does not decompress to its size.")
    planes = np.asarray(decoded, np.uint16).reshape(header.rows, header.cols, header.components)
    _check_length(stream, planes)
    return planes.reshape(-1), stream.end


def parse(data: bytes) -> Stream:
    """Read the markers up to the scan."""
    for marker, _, end in _segments(data):
        if marker == _SOS:
            return Stream(_read_header(data[:end]), *_find_scan(data, end))
    raise _damaged()


@functools.lru_cache(maxsize=64)
def _read_header(data: bytes) -> Header:
    """Read the markers, of which most pieces of an image have the same."""
    frame: tuple[int, int, int, list[int]] | None = None
    tables: dict[int, bytes] = {}
    for marker, first, end in _segments(data):
        body = data[first:end]
        if marker == _SOF3:
            frame = _read_frame(body)
        elif marker == _DHT:
            tables.update(_read_tables(body))
        elif marker in _OTHER_FRAMES:
            raise files.LOSSY_DNG.refuse("The image is compressed with loss.")
        elif marker == _DRI and any(body):
            raise NotDecodedHereError("restart intervals")
        elif marker == _SOS and frame is not None:
            return Header(*frame[:3], *_read_scan_header(body, frame[3], tables))
    raise _damaged()


@functools.lru_cache(maxsize=64)
def rebuild(header: Header) -> bytes:
    single = len(set(header.tables)) == 1
    numbers = range(1, header.components + 1)
    frame = struct.pack(">BHHB", header.bits, header.rows, header.cols, header.components)
    frame += b"".join(bytes([number, 0x11, 0]) for number in numbers)
    kept = header.tables[:1] if single else header.tables
    huffman = b"".join(bytes([number]) + table for number, table in enumerate(kept))
    scan = bytes([header.components])
    scan += b"".join(bytes([number, 0 if single else (number - 1) << 4]) for number in numbers)
    scan += bytes([header.predictor, 0, 0])
    return _START + b"".join(
        struct.pack(">BBH", 0xFF, marker, len(body) + 2) + body
        for marker, body in ((_SOF3, frame), (_DHT, huffman), (_SOS, scan))
    )


def _segments(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Return each marker, and where its body begins and ends."""
    if data[:2] != _START:
        raise _damaged()
    position = 2
    while position + 4 <= len(data):
        prefix, marker, length = struct.unpack_from(">BBH", data, position)
        if prefix != 0xFF:
            raise _damaged()
        if marker == 0xFF:
            position += 1
            continue
        end = position + 2 + length
        if length < 2 or end > len(data):
            raise _damaged()
        yield marker, position + 4, end
        position = end


def _read_frame(body: bytes) -> tuple[int, int, int, list[int]]:
    if len(body) < 6:
        raise _damaged()
    bits, rows, cols, components = struct.unpack(">BHHB", body[:6])
    if not (2 <= bits <= 16 and rows and cols and 1 <= components <= _MAX_COMPONENTS):
        raise _damaged()
    if len(body) != 6 + 3 * components:
        raise _damaged()
    if any(body[7 + 3 * index] != 0x11 for index in range(components)):
        raise NotDecodedHereError("subsampled components")
    return bits, rows, cols, [body[6 + 3 * index] for index in range(components)]


def _read_tables(body: bytes) -> dict[int, bytes]:
    tables = {}
    while body:
        counts = body[1:17]
        table = body[1 : 17 + sum(counts)]
        if len(counts) < 16 or len(table) < 16 + sum(counts) or body[0] > 3:
            raise _damaged()
        # Kraft's inequality: more codes than fit would overrun the decoders' tables.
        room = sum(count << (16 - length) for length, count in enumerate(counts, start=1))
        values = table[16:]
        if room > 1 << 16 or not values or max(values) > 16 or len(set(values)) != len(values):
            raise _damaged()
        tables[body[0]] = table
        body = body[len(table) + 1 :]
    return tables


def _read_scan_header(body: bytes, ids: list[int], tables: dict[int, bytes]) -> tuple[tuple[bytes, ...], int]:
    if len(body) != 1 + 2 * len(ids) + 3 or body[0] != len(ids):
        raise NotDecodedHereError("components in separate scans")
    chosen = [tables.get(body[2 + 2 * index] >> 4) for index in range(len(ids))]
    predictor, low = body[-3], body[-1] & 15
    named = [body[1 + 2 * index] for index in range(len(ids))]
    if named != ids or not 1 <= predictor <= 7 or None in chosen:
        raise _damaged()
    if low:
        raise NotDecodedHereError("point transform")
    return tuple(table for table in chosen if table is not None), predictor


def _find_scan(data: bytes, start: int) -> tuple[memoryview, int, int]:
    """The scan up to its end marker, how many of its bytes are stuffed, and where the marker ends.

    In a scan every FF is followed by a 0, which is stuffed, or begins a marker; only the end marker may come.
    """
    coded = np.frombuffer(data, np.uint8)[start:]
    places = np.flatnonzero(coded[:-1] == 0xFF)
    following = coded[places + 1]
    markers = np.flatnonzero((following != 0) & (following != 0xFF))
    if not len(markers):
        raise files.TRUNCATED.refuse("A piece of the compressed image ends before its end marker.")
    if following[markers[0]] != _EOI:
        raise files.INCOMPLETE_IMAGE.refuse("A piece of the compressed image is broken off within.")
    end = int(places[markers[0]])
    stuffed = int(np.count_nonzero(following[: markers[0]] == 0))
    if not end:
        raise _damaged()
    return memoryview(data)[start : start + end], stuffed, start + end + 2


def _check_length(stream: Stream, planes: NDArray[np.uint16]) -> None:
    available = 8 * (len(stream.scan) - stream.stuffed)
    needed = 0
    differences = _differences(planes, stream.header)
    tables = stream.header.tables
    if len(set(tables)) == 1:
        needed = _count_bits(differences, tables[0])
    else:
        for component, table in enumerate(tables):
            needed += _count_bits(differences[:, :, component], table)
    if needed > available:
        raise files.TRUNCATED.refuse("A piece of the compressed image ends early.")
    spare = available - needed
    if spare >= _SPARE_BITS or not _is_filler(stream.scan, spare // 8):
        raise files.SIZE_MISMATCH.refuse("A piece of the compressed image does not add up.")


def _is_filler(scan: memoryview, count: int) -> bool:
    """Return True if the scan's last bytes hold nothing; else codes of no table were read as something."""
    plain = bytes(scan[-2 * (count + 1) :]).replace(b"\xff\0", b"\xff")
    return count == 0 or set(plain[-count:]) in ({0}, {0xFF})


def _count_bits(differences: NDArray[np.uint16], table: bytes) -> int:
    # a number of 16 bits never leaves the table: "wrap" only spares numpy the look
    costs = np.take(_bit_costs(table), differences, mode="wrap").reshape(len(differences), -1)
    # 2^16 rows of one byte each stay below 2^32, and numpy adds in that width twice as fast as in 64 bits
    return int(costs.sum(axis=0, dtype=np.uint32).sum(dtype=np.uint64))


def _differences(planes: NDArray[np.uint16], header: Header) -> NDArray[np.uint16]:
    """Return what the encoder wrote: each sample less its prediction, modulo 2^16 (ITU T.81, table H.1)."""
    out = np.empty_like(planes)
    flat, apart = planes.reshape(-1), header.components
    row = header.cols * apart
    # All in one row, of which numpy makes one loop: what this says of each first column is put right below.
    left, above, corner = flat[row:-apart], flat[apart:-row], flat[: -row - apart]
    predicted = _predict(header.predictor, left, above, corner)
    np.subtract(flat[row + apart :], predicted, out=out.reshape(-1)[row + apart :])
    np.subtract(planes[1:, 0], planes[:-1, 0], out=out[1:, 0])
    np.subtract(planes[0, 1:], planes[0, :-1], out=out[0, 1:])
    out[0, 0] = planes[0, 0] - np.uint16(1 << (header.bits - 1))
    return out


def _predict(
    predictor: int, left: NDArray[np.uint16], above: NDArray[np.uint16], corner: NDArray[np.uint16]
) -> NDArray[np.uint16]:
    predicted: NDArray[np.uint16] = left
    match predictor:
        case 2:
            predicted = above
        case 3:
            predicted = corner
        case 4:
            predicted = left + above - corner
        case 5:
            predicted = left + _halve_difference(above, corner)
        case 6:
            predicted = above + _halve_difference(left, corner)
        case 7:
            predicted = np.asarray((left >> 1) + (above >> 1) + (left & above & 1), np.uint16)
    return predicted


def _halve_difference(first: NDArray[np.uint16], second: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """(first - second) / 2 rounded down, modulo 2^16; a wider type would take five times as long."""
    if first.max(initial=0) | second.max(initial=0) < 1 << 15:
        narrow = first.view(np.int16) - second.view(np.int16)
        narrow >>= 1
        return narrow.view(np.uint16)
    odd = ~first
    odd &= second
    odd &= 1
    halved = np.asarray(first >> 1, np.uint16)
    halved -= second >> 1
    halved -= odd
    return halved


@functools.lru_cache(maxsize=64)
def _bit_costs(table: bytes) -> NDArray[np.uint8]:
    """Bits that the table spends on each difference; one that it cannot write costs most."""
    code_bits = [255] * 17
    lengths = np.repeat(np.arange(1, 17), list(table[:16])).tolist()
    for length, category in zip(lengths, table[16:], strict=True):
        # Category 16 stands for one single difference, 32768, and is followed by nothing.
        code_bits[category] = length + (category if category < 16 else 0)
    costs = np.empty(_DIFFERENCES, np.uint8)
    costs[0], costs[_DIFFERENCES // 2] = code_bits[0], code_bits[16]
    for bits in range(1, 16):
        # magnitudes of so many bits, and the same ones below zero
        low, high = 1 << (bits - 1), 1 << bits
        costs[low:high] = costs[_DIFFERENCES + 1 - high : _DIFFERENCES + 1 - low] = code_bits[bits]
    return costs


def _damaged() -> Exception:
    return files.SIZE_MISMATCH.refuse("A piece of the compressed image has a damaged header.")
