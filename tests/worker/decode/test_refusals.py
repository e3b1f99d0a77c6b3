"""Every reason for which a file is refused, and that its sentence says what to do."""

import struct

import numpy as np
import pytest

from radiometry.findings import InputRejected, files, shared
from simulation.dng import BYTE, DOUBLE, LONG, SHORT, TiffWriter
from tests.support import reader
from tests.worker.decode.dng_variants import Variant, make_dng, make_samples

SAMPLES = make_samples(64, 64, 16)
WHOLE = make_dng(SAMPLES, Variant())


def _code(path, window=None):
    with pytest.raises(InputRejected) as caught:
        reader.read_window(path, *(window or (0, 0, 16, 16)))
    assert caught.value.message.endswith(".")
    return caught.value.code


def _dng(**extra):
    return make_dng(SAMPLES, Variant(extra={int(tag[1:]): value for tag, value in extra.items()}))


@pytest.mark.parametrize(
    "content",
    [
        b"GIF89a" + bytes(100),
        b"%PDF-1.7 and so on",
        b"exposure, aperture\n1/60, 8\n",
        b'{"frames": []}',
        b"PK\x03\x04" + bytes(60),
        b"II+\0" + bytes(60),
        b"x",
        b"FUJIFILMCCD-RAW " + bytes(200),
        b"\0\0\0\x18ftypcrx " + bytes(200),
    ],
)
def test_other_kinds_of_file(content, save):
    assert _code(save(content)) is files.NOT_A_RAW_FILE


@pytest.mark.parametrize(
    ("tag", "value", "code"),
    [
        ("t256", (LONG, 70_000), files.FRAME_TOO_LARGE),
        ("t257", (LONG, 2**32 - 1), files.FRAME_TOO_LARGE),
        ("t256", (LONG, 15), files.FRAME_TOO_SMALL),
        ("t257", (LONG, 0), files.FRAME_TOO_SMALL),
        ("t257", (LONG, 65), files.TRUNCATED),
        ("t279", (LONG, 64 * 64), files.SIZE_MISMATCH),
        ("t278", (LONG, 0), files.SIZE_MISMATCH),
        ("t278", (LONG, 16), files.TRUNCATED),
        ("t273", (LONG, 10_000_000), files.TRUNCATED),
        ("t273", (DOUBLE, 1e300), files.UNSUPPORTED_LAYOUT),
        ("t256", (DOUBLE, 64.5), files.UNSUPPORTED_LAYOUT),
        ("t256", (DOUBLE, float("nan")), files.UNSUPPORTED_LAYOUT),
        ("t273", (LONG, [8, 8]), files.SIZE_MISMATCH),
        ("t258", (SHORT, 32), files.UNSUPPORTED_LAYOUT),
        ("t258", (SHORT, 4), files.UNSUPPORTED_LAYOUT),
        ("t339", (SHORT, 3), files.UNSUPPORTED_LAYOUT),
        ("t277", (SHORT, 2), files.SIZE_MISMATCH),
        ("t266", (SHORT, 2), files.UNSUPPORTED_LAYOUT),
        ("t262", (SHORT, 34892), files.UNSUPPORTED_LAYOUT),  # a mosaic turned to grey
        ("t262", (SHORT, 1), files.UNSUPPORTED_LAYOUT),
        ("t50717", (SHORT, 0), files.LEVELS_CONTRADICTORY),
        ("t259", (SHORT, 34892), files.LOSSY_DNG),
        ("t259", (SHORT, 52546), files.UNSUPPORTED_COMPRESSION),
        ("t259", (SHORT, 9), files.UNSUPPORTED_COMPRESSION),
        ("t33422", (BYTE, b"\0\1\1\1"), files.UNSUPPORTED_LAYOUT),
        ("t33421", (SHORT, [4, 4]), files.UNSUPPORTED_LAYOUT),
        ("t50711", (SHORT, 2), files.UNSUPPORTED_LAYOUT),
        ("t50975", (LONG, 2), files.UNSUPPORTED_LAYOUT),
        ("t50829", (LONG, [0, 0, 65, 64]), files.SIZE_MISMATCH),
        ("t50829", (LONG, [0, 0, 64]), files.SIZE_MISMATCH),
        ("t50829", (LONG, [0, 0, 10, 64]), files.FRAME_TOO_SMALL),
        ("t50713", (SHORT, [0, 2]), files.UNSUPPORTED_LAYOUT),
        ("t50715", (SHORT, [1, 2, 3]), files.SIZE_MISMATCH),
        ("t254", (LONG, 1), files.NOT_A_RAW_FILE),
    ],
)
def test_tags_that_cannot_be(tag, value, code, save):
    assert _code(save(_dng(**{tag: value}))) is code


def test_linear_image_of_a_monochrome_sensor_is_read(save):
    path = save(_dng(t262=(SHORT, 34892), t33421=None, t33422=None))
    frame = reader.read_window(path, 0, 0, 64, 64)
    assert frame.cfa == "grey"
    assert np.array_equal(frame.samples_dn, SAMPLES)


def test_image_data_cut_from_the_end_of_the_file(save):
    # The directories come first, as cameras write them: only the samples are missing.
    content = make_dng(SAMPLES, Variant(extra={273: (LONG, len(WHOLE))})) + SAMPLES.tobytes()
    reader.read_header(save(content))
    assert _code(save(content[:-1])) is files.TRUNCATED


def _claim(count):
    """A file whose linearisation table says that it has so many values."""
    content = bytearray(make_dng(SAMPLES, Variant(table=(1, 2, 3, 4))))
    entry = content.rindex(struct.pack("<HH", 50712, SHORT))
    struct.pack_into("<I", content, entry + 4, count)
    return bytes(content)


def _nested(depth):
    writer = TiffWriter()
    place = writer.directory({256: (LONG, 1)})
    for _ in range(depth):
        place = writer.directory({330: (LONG, place)})
    return writer.finish(place)


def _own_child():
    writer = TiffWriter()
    assert writer.directory({330: (LONG, 8)}) == 8
    return writer.finish(8)


def _tiled(side, **tags):
    stated = {int(tag[1:]): (LONG, value) for tag, value in tags.items()}
    return make_dng(SAMPLES, Variant(tile=(side, side), extra=stated))


@pytest.mark.parametrize(
    ("content", "code"),
    [
        (b"", files.EMPTY_FILE),
        *((WHOLE[: int(len(WHOLE) * kept)], files.TRUNCATED) for kept in (0.5, 0.9, 0.99)),
        (_dng(t50714=(SHORT, 4095), t50717=(SHORT, 4095)), files.LEVELS_CONTRADICTORY),
        (_dng(t262=(SHORT, 34892), t277=(SHORT, 3), t33421=None, t33422=None), files.LINEAR_RAW),
        (_dng(t50714=(SHORT, [1, 2, 3]), t50713=(SHORT, [2, 2])), files.UNSUPPORTED_LAYOUT),
        (_tiled(16, t323=0, t322=16), files.SIZE_MISMATCH),
        (_tiled(16, t323=16, t322=0), files.SIZE_MISMATCH),
        (_tiled(64, t322=1 << 30), files.FRAME_TOO_LARGE),
        (_tiled(64, t256=60_000, t257=4_000, t322=1, t323=1), files.FRAME_TOO_LARGE),
        (_claim(2**32 - 1), files.FRAME_TOO_LARGE),
        (_claim(60_000), files.TRUNCATED),
        (_own_child(), files.UNSUPPORTED_LAYOUT),
        (_nested(10), files.UNSUPPORTED_LAYOUT),
        (b"II*\0\x08\0\0\0" + struct.pack("<H", 3000) + bytes(40_000), files.FRAME_TOO_LARGE),
    ],
)
def test_files_that_cannot_be(content, code, save):
    assert _code(save(content)) is code


def _ljpeg(cut):
    """A DNG of one lossless JPEG strip that ``cut`` has changed, with its length stated as it is."""
    variant = Variant(compression="ljpeg", bits=16)
    content = make_dng(SAMPLES, variant)
    jpeg = cut(content[8 : content.index(b"\xff\xd9", 8) + 2])
    moved = len(content)
    tags = {273: (LONG, moved), 279: (LONG, len(jpeg))}
    return make_dng(SAMPLES, Variant(compression="ljpeg", bits=16, extra=tags)) + jpeg


@pytest.mark.parametrize(
    ("cut", "code"),
    [
        (lambda jpeg: jpeg[:-40], files.TRUNCATED),
        (lambda jpeg: jpeg[: len(jpeg) // 2], files.TRUNCATED),
        (lambda jpeg: jpeg[: len(jpeg) // 2] + b"\xff\xd9", files.TRUNCATED),
        (lambda jpeg: jpeg[:-2] + bytes(40) + b"\xff\xd9", files.SIZE_MISMATCH),
        (lambda jpeg: jpeg[:20], files.SIZE_MISMATCH),
        (lambda jpeg: jpeg.replace(b"\xff\xc3", b"\xff\xc0", 1), files.LOSSY_DNG),
        (lambda jpeg: jpeg.replace(b"\0\x40\0\x40", b"\0\x40\0\x41", 1), files.SIZE_MISMATCH),
        (lambda jpeg: jpeg.replace(b"\xff\xd8", b"\0\0", 1), files.SIZE_MISMATCH),
    ],
)
def test_lossless_jpeg_that_is_damaged(cut, code, save):
    assert _code(save(_ljpeg(cut))) is code


def test_intact_lossless_jpeg_passes_the_same_way(save):
    frame = reader.read_window(save(_ljpeg(lambda jpeg: jpeg)), 0, 0, 64, 64)
    np.testing.assert_array_equal(frame.samples_dn, SAMPLES)


@pytest.mark.parametrize(
    "window", [(-1, 0, 4, 4), (0, 0, 65, 4), (60, 0, 5, 4), (0, 62, 4, 3), (0, 0, 0, 4), (0, 0, 4, -1)]
)
def test_window_outside_the_frame(window, save):
    assert _code(save(_dng()), window) is shared.ROI_OUTSIDE_FRAME


def test_real_files(real_files):
    assert _code(real_files / "dng" / "one_pixel.dng") is files.FRAME_TOO_SMALL
    assert _code(real_files / "dng" / "truncated_libraw_reads_zeros.dng") is files.TRUNCATED
