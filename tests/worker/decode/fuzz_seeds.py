"""Whole files to be damaged: one of every way to store pixels, and the real ones where they are."""

import hashlib
import io
import struct
from collections.abc import Iterator
from dataclasses import dataclass

import imagecodecs
import numpy as np
import tifffile

from simulation.dng import ASCII, BYTE, LONG, RATIONAL, SHORT, TiffWriter
from tests.support.data import FOLDER
from tests.worker.decode.dng_variants import Variant, black_level, make_dng, opcode_list
from worker.decode import pictures, tags
from worker.decode.layout import read_layout
from worker.decode.tiff import is_tiff, read_directories

ROWS, COLS, BLACK = 96, 160, 256
REAL = (
    "dng/blackmagic_bigendian_ljpeg_tiled.dng",
    "dng/canon_14bit_packed_activearea_zero_exif.dng",
    "sequoia/IMG_180413_080658_0000_GRE.TIF",
    "edge/Test_edge1.tif",
    "checkerboard/left01.jpg",
)
REAL_FOLDERS = ("rededge", "p4m")


@dataclass(frozen=True)
class Seed:
    """``body`` : where its pixels lie, (start, end); ``row_bytes`` : of an uncompressed image, else 0."""

    name: str
    content: bytes
    body: tuple[tuple[int, int], ...]
    row_bytes: int


def make_seeds() -> list[Seed]:
    """One small file of every way to store pixels."""
    return [_describe(name, content) for name, content in _generate()]


def find_real_seeds() -> list[Seed]:
    paths = [FOLDER / name for name in REAL]
    paths += [
        path for folder in REAL_FOLDERS for path in sorted((FOLDER / folder).glob("*.[tT][iI][fF]"))[:1]
    ]
    return [_describe(path.name, path.read_bytes()) for path in paths if path.is_file()]


def make_exif() -> bytes:
    writer = TiffWriter(">")
    stated = {33434: (RATIONAL, (1, 250)), 33437: (RATIONAL, (56, 10)), 34855: (SHORT, 200)}
    inner = writer.directory(stated | {42033: (ASCII, "S1")})
    named = {271: (ASCII, "Make"), 272: (ASCII, "Model"), 34665: (LONG, inner)}
    return writer.finish(writer.directory(named))


def add_segment(jpeg: bytes, marker: int, body: bytes) -> bytes:
    return jpeg[:2] + struct.pack(">BBH", 0xFF, marker, len(body) + 2) + body + jpeg[2:]


def _mosaic(bits: int) -> np.ndarray:
    """Lit everywhere, with noise, well below white."""
    light = np.linspace(900, 2400, COLS)[None, :]
    noisy = np.random.default_rng(7).normal(light, 12.0, (ROWS, COLS))
    return (noisy / 16 if bits == 8 else noisy).astype(np.uint16)


def _generate() -> Iterator[tuple[str, bytes]]:
    stated = black_level([BLACK])
    opcodes = opcode_list((9, bytes(40)), (3, bytes(60)))
    variants = {
        "dng 16 bit": Variant(extra=stated),
        "dng 12 bit": Variant(bits=12, extra=stated),
        "dng tiles": Variant(tile=(32, 64), order=">", extra=stated | {51009: opcodes}),
        "dng table": Variant(bits=8, table=tuple(range(0, 2560, 10)), thumbnail=True),
        "dng strips, black 0": Variant(rows_per_strip=16),
        "ljpeg tiles": Variant(compression="ljpeg", bits=12, tile=(32, 64), extra=stated),
        "ljpeg, two tables": Variant(compression="ljpeg", bits=12, components=2, tables=2, extra=stated),
        "ljpeg, predictor 6": Variant(compression="ljpeg", bits=12, predictor=6, extra=stated),
    }
    for name, variant in variants.items():
        yield name, make_dng(_mosaic(variant.bits), variant)
    for name in ("dng 16 bit", "ljpeg tiles"):
        variant = variants[name]
        samples = _mosaic(variant.bits)
        whole = hashlib.md5(samples.astype("<u2").tobytes(), usedforsecurity=False).digest()
        tile = hashlib.md5(whole, usedforsecurity=False).digest()
        for tag, digest in ((tags.RAW_IMAGE_DIGEST, whole), (tags.NEW_RAW_IMAGE_DIGEST, tile)):
            told = Variant(**{**vars(variant), "main": {tag: (BYTE, digest)}})
            yield f"{name}, digest {tag}", make_dng(samples, told)
    for compression in ("zlib", "lzw", "packbits"):
        for predictor in (False, True) if compression != "packbits" else (False,):
            target = io.BytesIO()
            tifffile.imwrite(
                target,
                _mosaic(16),
                compression=compression,
                predictor=predictor,
                rowsperstrip=16,
                photometric="minisblack",
            )
            yield f"tiff {compression}{', predictor' if predictor else ''}", target.getvalue()
    yield "png", imagecodecs.png_encode(_mosaic(16))
    jpeg = imagecodecs.jpeg8_encode(_mosaic(8).astype(np.uint8), level=90)
    yield "jpeg", jpeg
    yield "jpeg with exif", add_segment(jpeg, 0xE1, b"Exif\0\0" + make_exif())


def _describe(name: str, content: bytes) -> Seed:
    if is_tiff(content):
        raw = max(read_directories(content), key=lambda each: each.integer(tags.IMAGE_WIDTH, 0))
        layout = read_layout(raw, len(content))
        places = zip(layout.offsets.tolist(), layout.byte_counts.tolist(), strict=True)
        body = tuple((start, start + count) for start, count in places)
        return Seed(name, content, body, layout.row_bytes if layout.compression == tags.UNCOMPRESSED else 0)
    if content.startswith(pictures.PNG_MAGIC):
        start = content.index(b"IDAT") - 4
        return Seed(name, content, ((start, content.index(b"IEND") - 4),), 0)
    return Seed(name, content, ((content.index(b"\xff\xda"), len(content)),), 0)
