"""Compressed pieces have to end where they say, whatever part of them is wanted."""

import io
import zlib

import numpy as np
import pytest
import tifffile

from radiometry.findings import InputRejected, files
from simulation.dng import LONG, SHORT, TiffWriter
from tests.support import reader
from tests.worker.decode.dng_variants import Variant, make_dng, make_samples

ROWS, COLS, STRIP = 40, 50, 16
IMAGE = np.random.default_rng(3).integers(0, 1 << 16, (ROWS, COLS)).astype(np.uint16)


def _tiff(pieces, compression, strip=STRIP):
    writer = TiffWriter()
    offsets = [writer.append(piece) for piece in pieces]
    entries = {
        256: (LONG, COLS),
        257: (LONG, ROWS),
        258: (SHORT, 16),
        259: (SHORT, compression),
        262: (SHORT, 1),
        273: (LONG, offsets),
        277: (SHORT, 1),
        278: (LONG, strip),
        279: (LONG, [len(piece) for piece in pieces]),
    }
    return writer.finish(writer.directory(entries))


PACKED = [zlib.compress(IMAGE[top : top + STRIP].tobytes()) for top in range(0, ROWS, STRIP)]


def _deflated(change):
    return _tiff([PACKED[0], change(PACKED[1]), PACKED[2]], 8)


def _read(path, row0=STRIP, height=1):
    return reader.read_window(path, row0, 0, height, COLS).samples_dn


@pytest.mark.parametrize(
    "change",
    [
        lambda data: data[:-1] + bytes([data[-1] ^ 1]),
        lambda data: data[:-4],
        lambda data: data + b"what another file left",
        lambda data: zlib.compress(zlib.decompress(data) + b"more"),
        lambda data: data[:100] + bytes([data[100] ^ 64]) + data[101:],
    ],
    ids=["checksum", "no checksum", "trailing bytes", "longer", "a bit within"],
)
def test_deflate_that_does_not_end_with_its_checksum(change, save):
    path = save(_deflated(change))
    with pytest.raises(InputRejected) as caught:
        _read(path)
    assert caught.value.code is files.INCOMPLETE_IMAGE
    np.testing.assert_array_equal(_read(path, 0), IMAGE[:1])  # another strip: it is not looked at


def test_deflate_with_a_whole_last_strip_and_padding_is_read(save):
    padded = np.concatenate([IMAGE, IMAGE[:8]])
    strips = [zlib.compress(padded[top : top + STRIP].tobytes()) + b"\0" for top in range(0, ROWS, STRIP)]
    np.testing.assert_array_equal(_read(save(_tiff(strips, 8)), 0, ROWS), IMAGE)


@pytest.mark.parametrize("compression", ["lzw", "packbits"])
def test_piece_that_lost_its_end_or_runs_on(compression, save):
    target = io.BytesIO()
    tifffile.imwrite(target, IMAGE, compression=compression, rowsperstrip=ROWS, photometric="minisblack")
    with tifffile.TiffFile(io.BytesIO(target.getvalue())) as file:
        page = file.pages[0]
        offset, count, number = page.dataoffsets[0], page.databytecounts[0], page.tags[259].value
    packed = target.getvalue()[offset : offset + count]
    more = {"lzw": packed[:-2], "packbits": packed + b"\x00\x07"}[compression]
    for piece, ends in ((packed, True), (packed[: len(packed) // 2], False), (more, False)):
        path = save(_tiff([piece], number, strip=ROWS))
        if ends:
            np.testing.assert_array_equal(_read(path, 0, ROWS), IMAGE)
            continue
        with pytest.raises(InputRejected) as caught:
            _read(path, 0, 1)
        assert caught.value.code in (files.INCOMPLETE_IMAGE, files.TRUNCATED)


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (lambda jpeg: jpeg[:-2], files.TRUNCATED),
        (lambda jpeg: jpeg[:-60] + b"\xff\xd0" + jpeg[-58:], files.INCOMPLETE_IMAGE),
    ],
    ids=["no end marker", "another marker within"],
)
def test_lossless_jpeg_has_to_reach_its_end_marker(change, code, save):
    samples = make_samples(64, 64, 16)
    content = make_dng(samples, Variant(compression="ljpeg"))
    start = content.index(b"\xff\xd8")
    end = content.index(b"\xff\xd9", start) + 2
    changed = change(content[start:end])
    place = len(content) + len(content) % 2
    extra = {273: (LONG, place), 279: (LONG, len(changed))}
    again = make_dng(samples, Variant(compression="ljpeg", extra=extra)).ljust(place, b"\0") + changed
    with pytest.raises(InputRejected) as caught:
        reader.read_window(save(again), 0, 0, 1, 1)
    assert caught.value.code is code
