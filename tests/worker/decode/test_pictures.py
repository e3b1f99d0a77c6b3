"""JPEG and PNG: read as they are, refused by name when they are damaged or claim what they do not hold."""

import struct
import zlib

import cv2
import imagecodecs
import numpy as np
import pytest

from radiometry.findings import InputRejected, files
from tests.support import reader
from tests.worker.decode.fuzz_seeds import add_segment, make_exif

GREY = np.random.default_rng(3).integers(0, 256, (48, 80), np.uint8)
RGB = np.random.default_rng(4).integers(0, 256, (48, 80, 3), np.uint8)
JPEG = imagecodecs.jpeg8_encode(GREY, level=95)
JPEG_RGB = imagecodecs.jpeg8_encode(RGB, level=95)
PNG = imagecodecs.png_encode(RGB)
PNG_16 = imagecodecs.png_encode(GREY.astype(np.uint16) * 257)


def _with_chunk(png, kind, body):
    chunk = struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
    return png[:33] + chunk + png[33:]


def _head(png, **changes):
    fields = dict(zip("whdc", struct.unpack(">IIBB", png[16:26]), strict=True)) | changes
    body = b"IHDR" + struct.pack(">IIBB", *fields.values()) + png[26:29]
    return png[:12] + body + struct.pack(">I", zlib.crc32(body)) + png[33:]


def _sized(jpeg, height, width):
    at = jpeg.index(b"\xff\xc0") + 5
    return jpeg[:at] + struct.pack(">HH", height, width) + jpeg[at + 4 :]


@pytest.mark.parametrize(
    ("content", "container", "bits", "expected"),
    [
        (JPEG, "jpeg", 8, imagecodecs.jpeg8_decode(JPEG)),
        (JPEG_RGB, "jpeg", 8, imagecodecs.jpeg8_decode(JPEG_RGB)),
        (PNG, "png", 8, RGB),
        (PNG_16, "png", 16, GREY.astype(np.uint16) * 257),
        (cv2.imencode(".jpg", GREY, [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])[1].tobytes(), "jpeg", 8, None),
    ],
    ids=["grey jpeg", "colour jpeg", "colour png", "deep png", "progressive jpeg"],
)
def test_picture_is_read_as_it_is(content, container, bits, expected, save):
    path = save(content, "picture.dng")
    header = reader.read_header(path)
    if expected is None:
        expected = imagecodecs.jpeg8_decode(content)
    cfa = "rgb" if expected.ndim == 3 else "grey"
    assert (header.container, header.cfa, header.rendered) == (container, cfa, True)
    assert (header.height_px, header.width_px, header.bits_per_sample) == (48, 80, bits)
    frame = reader.read_window(path, 5, 7, 20, 31)
    assert frame.samples_dn.dtype == np.uint16
    np.testing.assert_array_equal(frame.samples_dn, expected[5:25, 7:38])
    assert set(frame.white_level_dn) == {2.0**bits - 1}
    assert imagecodecs.png_decode(reader.render_preview(path, 40)).shape == (24, 40)


@pytest.mark.parametrize(
    "content", [add_segment(JPEG, 0xE1, b"Exif\0\0" + make_exif()), _with_chunk(PNG, b"eXIf", make_exif())]
)
def test_exif_of_a_picture(content, save):
    header = reader.read_header(save(content))
    assert (header.exposure_time_s, header.f_number, header.iso) == (0.004, 5.6, 200.0)
    assert (header.make, header.model, header.serial) == ("Make", "Model", "S1")


@pytest.mark.parametrize("exif", [b"", b"II*\0", b"II*\0\xff\xff\xff\xff", b"nonsense", make_exif()[:60]])
def test_damaged_exif_costs_the_metadata_only(exif, save):
    header = reader.read_header(save(add_segment(JPEG, 0xE1, b"Exif\0\0" + exif)))
    assert header.exposure_time_s is None
    assert header.width_px == 80


@pytest.mark.parametrize(
    ("content", "code"),
    [
        (JPEG[: len(JPEG) // 2], files.TRUNCATED),
        (JPEG[:-2], files.TRUNCATED),
        (JPEG[:20], files.TRUNCATED),
        (JPEG[:3], files.TRUNCATED),
        (b"\xff\xd8\xff\xd9", files.SIZE_MISMATCH),
        (b"\xff\xd8\xff\xe0\0\0" + JPEG, files.SIZE_MISMATCH),
        (b"\xff\xd8\xff\xe0\0\x04ab" + b"x" * 9, files.SIZE_MISMATCH),
        (b"\xff\xd8" + b"\xff\xe0\0\x02" * 10_001, files.UNSUPPORTED_LAYOUT),
        (_sized(JPEG, 60_000, 60_000), files.SIZE_MISMATCH),
        (_sized(JPEG, 0, 80), files.FRAME_TOO_SMALL),
        (_sized(JPEG, 48, 15), files.FRAME_TOO_SMALL),
        (JPEG.replace(b"\xff\xc0", b"\xff\xc9", 1), files.UNSUPPORTED_COMPRESSION),
        (JPEG.replace(b"\xff\xc0\0\x0b\x08", b"\xff\xc0\0\x0b\x0c", 1), files.UNSUPPORTED_LAYOUT),
        (PNG[: len(PNG) // 2], files.TRUNCATED),
        (PNG[:-12], files.TRUNCATED),
        (PNG[:20], files.TRUNCATED),
        (PNG[:8] + PNG[33:], files.SIZE_MISMATCH),
        (_head(PNG, w=60_000, h=60_000), files.SIZE_MISMATCH),
        (_head(PNG, w=0), files.FRAME_TOO_SMALL),
        (_head(PNG, d=4, c=3), files.UNSUPPORTED_LAYOUT),
        (_head(PNG, c=6), files.UNSUPPORTED_LAYOUT),
        (_head(PNG, h=49), files.SIZE_MISMATCH),
        (PNG[:60] + bytes([PNG[60] ^ 1]) + PNG[61:], files.SIZE_MISMATCH),
    ],
)
def test_picture_that_cannot_be(content, code, save):
    path = save(content)
    with pytest.raises(InputRejected) as caught:
        reader.read_window(path, 0, 0, 16, 16)
    assert caught.value.code is code


def test_bomb_of_pixels_is_refused_before_it_is_decoded(save, monkeypatch):
    def decode(_data):
        pytest.fail("it was decoded")

    monkeypatch.setattr(imagecodecs, "png_decode", decode)
    monkeypatch.setattr(imagecodecs, "jpeg8_decode", decode)
    padded = _with_chunk(_head(PNG, w=20_000, h=10_000), b"IDAT", bytes(1 << 20))
    scan = JPEG.index(b"\xff\xda") + 10
    padded_jpeg = _sized(JPEG, 20_000, 10_000)
    padded_jpeg = padded_jpeg[:scan] + bytes(1 << 20) + padded_jpeg[scan:]
    for content in (padded, padded_jpeg):
        with pytest.raises(InputRejected, match="100 megapixels") as caught:
            reader.read_header(save(content))
        assert caught.value.code is files.FRAME_TOO_LARGE
