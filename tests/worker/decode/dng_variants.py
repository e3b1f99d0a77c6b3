"""DNG files of every kind that cameras and converters write, from samples that the test knows."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from simulation.dng import ASCII, BYTE, LONG, RATIONAL, SHORT, UNDEFINED, TiffWriter
from tests.worker.decode import ljpeg_encoder

PATTERNS = {"RGGB": b"\0\1\1\2", "GBRG": b"\1\2\0\1", "BGGR": b"\2\1\1\0", "GRBG": b"\1\0\2\1"}
COMPRESSION = {"none": 1, "ljpeg": 7}


@dataclass(frozen=True, kw_only=True)
class Variant:
    """How to store one mosaic. ``extra`` replaces or adds raw tags, ``main`` those of the first directory."""

    bits: int = 16
    order: str = "<"
    compression: str = "none"
    tile: tuple[int, int] | None = None
    rows_per_strip: int | None = None
    thumbnail: bool = False
    cfa: str = "RGGB"
    active_area: tuple[int, int, int, int] | None = None
    table: tuple[int, ...] | None = None
    predictor: int = 1
    components: int = 1
    tables: int = 1
    complete: bool = False
    extra: dict[int, Any] = field(default_factory=dict)
    main: dict[int, Any] = field(default_factory=dict)
    exif: dict[int, Any] = field(default_factory=dict)
    gps: dict[int, Any] = field(default_factory=dict)


def make_samples(rows, cols, bits, seed=1):
    """A gradient with noise: smooth enough for lossless JPEG, using the whole range."""
    rng = np.random.default_rng(seed)
    ramp = np.linspace(0, (1 << bits) - 1, rows * cols).reshape(rows, cols)
    noisy = ramp + rng.normal(0, (1 << bits) / 60, ramp.shape)
    return np.clip(noisy, 0, (1 << bits) - 1).astype(np.uint16)


def make_dng(samples, variant):
    writer = TiffWriter(variant.order)
    raw = _raw_entries(writer, samples, variant)
    main = {
        271: (ASCII, "Stilb"),
        272: (ASCII, "Testcam"),
        274: (SHORT, 1),
        50706: (BYTE, b"\1\4\0\0"),
        50708: (ASCII, "Stilb Testcam"),
    }
    if variant.exif:
        main[34665] = (LONG, writer.directory(variant.exif))
    if variant.gps:
        main[34853] = (LONG, writer.directory(variant.gps))
    if variant.thumbnail:
        main |= _thumbnail_entries(writer) | {330: (LONG, writer.directory(raw))}
    else:
        main |= raw
    return writer.finish(writer.directory(main | variant.main))


def expected_samples(samples, variant):
    """What a decoder must return: linearised, the visible area."""
    top, left, bottom, right = variant.active_area or (0, 0, *samples.shape)
    visible = samples[top:bottom, left:right]
    if variant.table is None:
        return visible
    return np.array(variant.table, np.uint16)[np.minimum(visible, len(variant.table) - 1)]


def _raw_entries(writer, samples, variant):
    rows, cols = samples.shape
    entries = {
        254: (LONG, 0),
        256: (LONG, cols),
        257: (LONG, rows),
        258: (SHORT, variant.bits),
        259: (SHORT, COMPRESSION[variant.compression]),
        262: (SHORT, 32803),
        277: (SHORT, 1),
        284: (SHORT, 1),
        33421: (SHORT, [2, 2]),
        33422: (BYTE, PATTERNS[variant.cfa]),
    }
    pieces = list(_pieces(samples, variant))
    offsets = [writer.append(piece) for piece in pieces]
    counts = [len(piece) for piece in pieces]
    if variant.tile:
        entries |= {322: (LONG, variant.tile[1]), 323: (LONG, variant.tile[0])}
        entries |= {324: (LONG, offsets), 325: (LONG, counts)}
    else:
        entries |= {273: (LONG, offsets), 278: (LONG, variant.rows_per_strip or rows), 279: (LONG, counts)}
    if variant.active_area:
        entries[50829] = (LONG, list(variant.active_area))
    if variant.table:
        entries[50712] = (SHORT, list(variant.table))
    return {tag: entry for tag, entry in (entries | variant.extra).items() if entry is not None}


def _pieces(samples, variant):
    rows, cols = samples.shape
    if variant.tile:
        high, wide = variant.tile
        padded = np.pad(samples, ((0, -rows % high), (0, -cols % wide)), mode="edge")
        for top in range(0, rows, high):
            for left in range(0, cols, wide):
                yield _compress(padded[top : top + high, left : left + wide], variant)
        return
    strip = variant.rows_per_strip or rows
    for top in range(0, rows, strip):
        yield _compress(samples[top : top + strip], variant)


def _compress(piece, variant):
    if variant.compression == "ljpeg":
        return ljpeg_encoder.encode(
            piece,
            bits=variant.bits,
            predictor=variant.predictor,
            components=variant.components,
            tables=variant.tables,
            complete=variant.complete,
        )
    if variant.bits == 16:
        return piece.astype(variant.order + "u2").tobytes()
    return pack(piece, variant.bits)


def pack(samples, bits):
    """Most significant bit first, each row starting on a byte of its own."""
    shifts = np.arange(bits - 1, -1, -1)
    return np.packbits(((samples[:, :, None] >> shifts) & 1).reshape(len(samples), -1), axis=1).tobytes()


def _thumbnail_entries(writer):
    place = writer.append(bytes(16 * 16 * 3))
    return {
        254: (LONG, 1),
        256: (LONG, 16),
        257: (LONG, 16),
        258: (SHORT, [8, 8, 8]),
        259: (SHORT, 1),
        262: (SHORT, 2),
        273: (LONG, place),
        277: (SHORT, 3),
        278: (LONG, 16),
        279: (LONG, 16 * 16 * 3),
    }


def opcode_list(*opcodes):
    """``opcodes`` : (number, parameter bytes)"""
    body = len(opcodes).to_bytes(4, "big")
    for number, parameters in opcodes:
        body += b"".join(value.to_bytes(4, "big") for value in (number, 0x01030000, 0, len(parameters)))
        body += parameters
    return UNDEFINED, body


def black_level(values, repeat=None, *, rational=False):
    """Tags for BlackLevel, over 256 when they are rational."""
    encoded = (
        (RATIONAL, [(round(value * 256), 256) for value in values]) if rational else (SHORT, list(values))
    )
    return {50714: encoded} | ({50713: (SHORT, list(repeat))} if repeat else {})
