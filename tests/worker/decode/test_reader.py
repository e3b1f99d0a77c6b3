"""Every variant, read natively, equals what went in and what LibRaw decodes."""

import io

import numpy as np
import pytest
import rawpy
import tifffile

from simulation.dng import LONG, SHORT
from tests.support import reader
from tests.worker.decode.dng_variants import Variant, expected_samples, make_dng, make_samples

ROWS, COLS = 70, 96
AREA = (6, 8, 68, 92)
SHORT_TABLE = tuple(int(value) for value in np.linspace(7, 60_000, 3000))

VARIANTS = {
    "16 bit": Variant(),
    "16 bit, big endian": Variant(order=">"),
    "8 bit": Variant(bits=8),
    "10 bit packed": Variant(bits=10),
    "12 bit packed": Variant(bits=12),
    "14 bit packed": Variant(bits=14),
    "12 bit packed, big endian": Variant(bits=12, order=">"),
    "14 bit packed, strips": Variant(bits=14, rows_per_strip=16),
    "16 bit, a strip for each row": Variant(rows_per_strip=1),
    "strips": Variant(rows_per_strip=13),
    "raw behind a thumbnail": Variant(thumbnail=True),
    "active area": Variant(active_area=AREA),
    "active area, 14 bit packed": Variant(bits=14, active_area=AREA),
    "odd active area": Variant(active_area=(5, 7, 66, 90)),
    "short table": Variant(bits=12, table=SHORT_TABLE),
    "8 bit with table": Variant(bits=8, table=tuple(range(0, 65_280, 255))),
    "GBRG": Variant(cfa="GBRG"),
    "BGGR": Variant(cfa="BGGR"),
    "GRBG": Variant(cfa="GRBG"),
    "tiles": Variant(tile=(32, 32)),
    "12 bit packed tiles": Variant(bits=12, tile=(32, 32)),
    "ljpeg tiles": Variant(compression="ljpeg", bits=14, tile=(32, 32)),
    "ljpeg tiles, big endian": Variant(compression="ljpeg", bits=12, tile=(32, 48), order=">"),
    "ljpeg tiles, two components": Variant(compression="ljpeg", bits=16, tile=(32, 32), components=2),
    "ljpeg tiles, a code of ones": Variant(compression="ljpeg", bits=12, tile=(32, 32), complete=True),
    "ljpeg tiles, two Huffman tables": Variant(
        compression="ljpeg", bits=12, tile=(32, 32), components=2, tables=2
    ),
    "ljpeg strip": Variant(compression="ljpeg", bits=12),
    "ljpeg, table, active area, thumbnail": Variant(
        compression="ljpeg", bits=12, tile=(32, 32), table=SHORT_TABLE, active_area=AREA, thumbnail=True
    ),
} | {
    f"ljpeg predictor {predictor}": Variant(
        compression="ljpeg", bits=14, tile=(32, 32), predictor=predictor, components=1 + predictor % 2
    )
    for predictor in range(1, 8)
}
# LibRaw takes the first strip for all, or cannot tell where the next one starts.
BEYOND_LIBRAW = {"ljpeg strips": Variant(compression="ljpeg", bits=12, rows_per_strip=16)}
WINDOWS = ((0, 0, 1, 1), (1, 3, 17, 21), (31, 31, 2, 2), (16, 33, 40, 45), (58, 82, 1, 1))


@pytest.mark.parametrize("name", VARIANTS | BEYOND_LIBRAW)
def test_every_window_equals_what_was_written_and_the_frame_what_libraw_reads(name, save):
    variant = (VARIANTS | BEYOND_LIBRAW)[name]
    samples = make_samples(ROWS, COLS, variant.bits)
    whole = expected_samples(samples, variant)
    path = save(make_dng(samples, variant))
    file = reader.open_reader(path)
    for row0, col0, height, width in ((0, 0, *whole.shape), *WINDOWS):
        frame = file.read_window(reader.Window(row0, col0, height, width))
        np.testing.assert_array_equal(frame.samples_dn, whole[row0 : row0 + height, col0 : col0 + width])
        assert (frame.row0, frame.col0) == (row0, col0)
        assert (frame.height_px, frame.width_px) == whole.shape
        assert frame.samples_dn.dtype == np.uint16
    header = file.read_header()
    assert (header.height_px, header.width_px, header.decoder) == (*whole.shape, "stilb")
    if name in BEYOND_LIBRAW:
        return
    with rawpy.imread(str(path)) as raw:
        # LibRaw moves odd margins inwards to even ones, with the pattern in phase.
        top, left, bottom, right = variant.active_area or (0, 0, ROWS, COLS)
        assert (raw.sizes.top_margin, raw.sizes.left_margin) == (top + top % 2, left + left % 2)
        np.testing.assert_array_equal(whole, raw.raw_image[top:bottom, left:right])
        letters = raw.color_desc.decode()
        phased = np.roll(raw.raw_pattern, (top % 2, left % 2), axis=(0, 1)).ravel()
        assert header.cfa == "".join(letters[index] for index in phased)


def test_strips_out_of_order_are_found_by_their_offsets(save):
    samples = make_samples(ROWS, COLS, 16)
    base = len(make_dng(samples, Variant(rows_per_strip=35)))
    base += base % 2
    half = samples[35:].nbytes
    # those of the file itself are in order: its offsets point at a copy behind it that is not
    variant = Variant(rows_per_strip=35, extra={273: (LONG, [base + half, base])})
    copy = samples[35:].tobytes() + samples[:35].tobytes()
    path = save(make_dng(samples, variant).ljust(base, b"\0") + copy)
    np.testing.assert_array_equal(reader.read_window(path, 30, 0, 10, COLS).samples_dn, samples[30:40])


def test_feature_that_is_not_read_natively_goes_to_libraw(save):
    samples = make_samples(ROWS, COLS, 12)
    content = make_dng(samples, Variant(compression="ljpeg", bits=12))
    # A restart interval of a whole scan changes nothing in the data, and is handed over all the same.
    restarting = b"\xff\xd8\xff\xdd\x00\x04\xff\xff"
    start = content.index(b"\xff\xd8\xff\xc3")
    moved = len(content) + len(content) % 2
    jpeg = restarting + content[start + 2 :]
    variant = Variant(compression="ljpeg", bits=12, extra={273: (LONG, moved), 279: (LONG, len(jpeg))})
    path = save(make_dng(samples, variant).ljust(moved, b"\0") + jpeg)
    file = reader.open_reader(path)
    frame = file.read_window(reader.Window(3, 5, 20, 30))
    with rawpy.imread(str(path)) as raw:
        np.testing.assert_array_equal(frame.samples_dn, raw.raw_image_visible[3:23, 5:35])
    assert file.read_header().decoder == "libraw"


@pytest.mark.parametrize(
    ("bits", "channels", "order"), [(8, 1, "<"), (16, 1, ">"), (8, 3, "<"), (16, 3, "<"), (16, 3, ">")]
)
@pytest.mark.parametrize("compression", ["none", "zlib", "lzw", "packbits"])
def test_tiff_is_read_as_written(bits, channels, order, compression, save):
    rng = np.random.default_rng(3)
    shape = (40, 50, 3) if channels == 3 else (40, 50)
    image = rng.integers(0, 1 << bits, shape).astype(f"u{bits // 8}")
    path = save(_tiff(image, order, compression), "picture.tif")
    header = reader.read_header(path)
    frame = reader.read_window(path, 11, 7, 20, 30)
    np.testing.assert_array_equal(frame.samples_dn, image[11:31, 7:37])
    assert (header.container, header.rendered) == ("tiff", True)
    assert header.cfa == ("rgb" if channels == 3 else "grey")
    assert header.white_level_dn == ((1 << bits) - 1,) * channels


def _tiff(image, order, compression):
    target = io.BytesIO()
    tifffile.imwrite(
        target,
        image,
        byteorder=order,
        compression=None if compression == "none" else compression,
        rowsperstrip=9,
        predictor=compression == "zlib",
        photometric="rgb" if image.ndim == 3 else "minisblack",
    )
    return target.getvalue()


def _means(samples):
    return [samples[row::2, col::2].mean() for row in (0, 1) for col in (0, 1)]


def _read_as_libraw_does(path):
    with rawpy.imread(str(path)) as raw:
        expected = raw.raw_image_visible.copy()
    samples = reader.read_window(path, 0, 0, *expected.shape).samples_dn
    np.testing.assert_array_equal(samples, expected)
    return samples


def test_blackmagic_samples_after_its_table(real_files):
    path = real_files / "dng" / "blackmagic_bigendian_ljpeg_tiled.dng"
    header, samples = reader.read_header(path), _read_as_libraw_does(path)
    assert samples.shape == (header.height_px, header.width_px) == (1112, 1952)
    assert (header.cfa, set(header.black_level_dn), set(header.white_level_dn)) == ("GBRG", {256}, {51080})
    assert (samples.min(), samples.max()) == (241, 22473)
    assert samples.mean() == pytest.approx(731.32, abs=0.005)
    assert _means(samples) == pytest.approx([790.2963, 838.7027, 517.5818, 778.6991], abs=5e-5)
    assert header.exposure_time_s is None


def test_canon_samples_in_the_whole_frame_and_its_active_area(real_files, save):
    path = real_files / "dng" / "canon_14bit_packed_activearea_zero_exif.dng"
    # The published numbers are of the whole frame: read it with the active area's tag renamed.
    area, unknown = (tag + b"\x04\x00\x04\x00\x00\x00" for tag in (b"\x8d\xc6", b"\xff\xfe"))
    content = path.read_bytes()
    assert content.count(area) == 1
    samples = reader.read_window(save(content.replace(area, unknown)), 0, 0, 1182, 1888).samples_dn
    assert (samples.min(), samples.max()) == (1702, 12128)
    assert _means(samples) == pytest.approx([2356.3603, 2704.0581, 2708.9549, 2529.019], abs=5e-5)
    np.testing.assert_array_equal(_read_as_libraw_does(path), samples[26:1182, 152:1886])


def test_short_strip_counts_of_single_values(save):
    samples = make_samples(ROWS, COLS, 16)
    path = save(make_dng(samples, Variant(extra={278: (SHORT, ROWS)})))
    np.testing.assert_array_equal(reader.read_window(path, 0, 0, ROWS, COLS).samples_dn, samples)
