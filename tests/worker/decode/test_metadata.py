"""What the header says, and that nothing is made up of zeros and nonsense."""

import hashlib
import math
from dataclasses import replace

import pytest

from radiometry.frame import Opcode
from simulation.dng import ASCII, BYTE, LONG, RATIONAL, SHORT, SRATIONAL
from tests.support import reader
from tests.support.data import data_file
from tests.worker.decode.dng_variants import Variant, black_level, make_dng, make_samples, opcode_list
from tests.worker.decode.spectral_tiff import make_tiff
from worker.decode.metadata import read_metadata
from worker.decode.tiff import read_directories

SAMPLES = make_samples(32, 48, 12)
EXIF = {
    33434: (RATIONAL, (1, 60)),
    33437: (RATIONAL, (28, 10)),
    34850: (SHORT, 1),
    34855: (SHORT, 800),
    36867: (ASCII, "2024:05:17 12:13:14"),
    36881: (ASCII, "+02:00"),
    37377: (SRATIONAL, (6, 1)),
    37378: (RATIONAL, (3, 1)),
    37521: (ASCII, "25"),
    41986: (SHORT, 1),
    42033: (ASCII, "BODY-1"),
    42035: (ASCII, "Lensmaker"),
    42036: (ASCII, "15mm F1.7"),
    42037: (ASCII, "LENS-9"),
}


@pytest.fixture
def header(save):
    def read(**changes):
        return reader.read_header(save(make_dng(SAMPLES, Variant(bits=12, **changes))))

    return read


@pytest.mark.parametrize("order", ["<", ">"])
def test_everything_that_is_stated(order, header):
    main = {305: (ASCII, "v1"), 274: (SHORT, 6), 50735: (ASCII, "SN 7")}
    found = header(exif=EXIF, main=main, order=order)
    assert (found.exposure_time_s, found.exposure_time_apex_s) == (1 / 60, 1 / 64)
    assert (found.f_number, found.f_number_apex) == (2.8, pytest.approx(math.sqrt(8)))
    assert (found.iso, found.exposure_program, found.exposure_mode) == (800, "manual", "manual")
    assert (found.make, found.model, found.serial) == ("Stilb", "Testcam", "SN 7")
    assert (found.lens_make, found.lens_model, found.lens_serial) == ("Lensmaker", "15mm F1.7", "LENS-9")
    assert found.taken_at == "2024-05-17T12:13:14.25+02:00"
    assert (found.orientation, found.software, found.bits_per_sample) == (6, "v1", 12)
    assert (found.container, found.decoder) == ("dng", "stilb")
    assert (found.rendered, found.compression) == (False, "none")
    assert found.sensor_temperature_c is None


def test_what_is_absent_is_none_and_the_serial_that_of_the_body(header):
    found = header(main={272: (ASCII, "")})
    assert found.model == "Stilb Testcam"
    stated = [found.exposure_time_s, found.f_number, found.iso, found.exposure_mode, found.serial]
    assert [*stated, found.taken_at, found.exposure_time_apex_s] == [None] * 7
    assert header(exif=EXIF).serial == "BODY-1"


@pytest.mark.parametrize(
    ("pair", "value", "apex"),
    [
        ((0, 0), None, 1.0),
        ((0, 1000000), 0.0, None),
        ((5, 0), None, 1.0),
        # zeros of a writer that knows nothing are not one second
        ((0, 1), 0.0, None),
        ((1, 1), 1.0, 1.0),
    ],
)
def test_rationals_with_zeros(pair, value, apex, header):
    found = header(exif={33434: (RATIONAL, pair), 33437: (RATIONAL, pair), 37377: (SRATIONAL, (0, 1))})
    assert (found.exposure_time_s, found.f_number, found.exposure_time_apex_s) == (value, value, apex)


@pytest.mark.parametrize(
    ("exif", "iso"),
    [
        ({34855: (SHORT, [200, 0])}, 200),
        ({34855: (SHORT, 65535), 34866: (LONG, 102400)}, 102400),
        ({34855: (SHORT, 0), 34866: (LONG, 400)}, 400),
        ({34867: (LONG, 100)}, 100),
        ({34865: (LONG, 320)}, 320),
        ({34855: (SHORT, 0)}, 0),
    ],
)
def test_iso_in_all_its_places(exif, iso, header):
    assert header(exif=exif).iso == iso


@pytest.mark.parametrize(
    ("stamp", "offset", "expected"),
    [
        ("2024:05:17 12:13:14", "Z", "2024-05-17T12:13:14Z"),
        ("2024:05:17 12:13:14", "   :  ", "2024-05-17T12:13:14"),
        ("2024:05:17 12:13:14", "+25:00", "2024-05-17T12:13:14"),
        ("0000:00:00 00:00:00", "+02:00", None),
        ("    :  :     :  :  ", "+02:00", None),
    ],
)
def test_times_that_are_none(stamp, offset, expected, header):
    assert header(exif={36867: (ASCII, stamp), 36881: (ASCII, offset)}).taken_at == expected


def test_text_is_cleaned_and_kept_short(header):
    found = header(main={271: (ASCII, " A\x01B\n"), 305: (ASCII, "x" * 3000), 50735: (ASCII, "\0\0")})
    assert (found.make, len(found.software), found.serial) == ("A B", 200, None)


def test_opcodes_of_all_lists(header):
    extra = {
        51008: opcode_list((1, b"warp")),
        51009: opcode_list((9, b"gain"), (9, b"other")),
        51022: opcode_list((3, b""), (4711, b"?")),
    }
    names = [(1, "WarpRectilinear"), (2, "GainMap"), (2, "GainMap"), (3, "FixVignetteRadial")]
    bodies = [b"warp", b"gain", b"other", b"", b"?"]
    expected = [
        Opcode(stage=stage, name=name, sha256=hashlib.sha256(body).hexdigest())
        for (stage, name), body in zip([*names, (3, "opcode-4711")], bodies, strict=True)
    ]
    assert list(header(extra=extra).opcodes) == expected


def test_opcode_list_cut_short_is_told_apart(header):
    kind, body = opcode_list((9, b"gain"), (3, b"vignette"))
    found = header(extra={51009: (kind, body[:-3])}).opcodes
    assert [opcode.name for opcode in found] == ["GainMap", "unreadable"]


def test_levels_that_are_stated_and_those_that_are_not(header):
    found = header()
    assert (found.black_level_dn, found.black_level_origin) == ((0.0,) * 4, "default")
    assert (found.white_level_dn, found.white_level_origin) == ((4095.0,) * 4, "default")
    assert header(table=(0, 100, 60_000)).white_level_dn == (60_000.0,) * 4
    found = header(extra=black_level([64.25, 65, 66, 67], (2, 2), rational=True) | {50717: (SHORT, 4000)})
    assert (found.black_level_dn, found.black_level_origin) == ((64.25, 65, 66, 67), "tag")
    assert (found.white_level_dn, found.white_level_origin) == ((4000.0,) * 4, "tag")
    pattern = [10, 20, 30, 40, 50, 60, 70, 80]  # 2 rows, 4 columns: the mean of each site
    assert header(extra=black_level(pattern, (2, 4))).black_level_dn == (20, 30, 60, 70)


def test_black_level_deltas_are_those_of_the_window(save):
    deltas_h = [(col, 1) for col in range(40)]
    deltas_v = [(10 * row, 1) for row in range(20)]
    extra = black_level([100]) | {50715: (SRATIONAL, deltas_h), 50716: (SRATIONAL, deltas_v)}
    variant = Variant(bits=12, active_area=(6, 4, 26, 44), extra=extra)
    path = save(make_dng(SAMPLES, variant))
    frame = reader.read_window(path, 3, 5, 4, 6)
    # Rows 3 to 6: even 4 and 6, odd 3 and 5. Columns 5 to 10: even 6, 8, 10, odd 5, 7, 9.
    rows, cols = {0: 50, 1: 40}, {0: 8, 1: 7}
    expected = [100 + rows[row] + cols[col] for row in (0, 1) for col in (0, 1)]
    assert frame.black_level_dn == pytest.approx(expected)
    # One pixel holds one site; the others are answered for their nearest lines.
    assert reader.read_window(path, 19, 39, 1, 1).black_level_dn[3] == 100 + 190 + 39


def test_truncated_file_still_tells_its_exposure(real_files):
    content = (real_files / "dng" / "truncated_libraw_reads_zeros.dng").read_bytes()
    found = read_metadata(read_directories(content)[0])
    assert (found["exposure_time_s"], found["f_number"], found["iso"]) == (1 / 15, 8.0, 400)
    assert (found["serial"], found["make"]) == ("012345678", "Canon")


def test_real_file_with_zeros_for_its_exposure(real_files):
    found = reader.read_header(real_files / "dng" / "canon_14bit_packed_activearea_zero_exif.dng")
    assert (found.exposure_time_s, found.f_number, found.exposure_time_apex_s) == (0.0, 0.0, None)
    assert (found.cfa, found.bits_per_sample, found.height_px, found.width_px) == ("RGGB", 14, 1156, 1734)
    assert (set(found.black_level_dn), set(found.white_level_dn)) == ({2056}, {15000})


LANSING = {
    1: (ASCII, "N"),
    2: (RATIONAL, [(42, 1), (43, 1), (57, 1)]),
    3: (ASCII, "W"),
    4: (RATIONAL, [(84, 1), (33, 1), (2016, 100)]),
    5: (BYTE, b"\0"),
    6: (RATIONAL, (2625, 10)),
}


@pytest.fixture
def position(save):
    def read(gps, **changes):
        path = save(make_dng(make_samples(32, 48, 16), Variant(gps=gps, **changes)))
        header = reader.read_header(path)
        return header.latitude_deg, header.longitude_deg, header.altitude_m

    return read


@pytest.mark.parametrize("order", ["<", ">"])
def test_degrees_minutes_and_seconds(order, position):
    expected = (42 + 43 / 60 + 57 / 3600, -(84 + 33 / 60 + 20.16 / 3600), 262.5)
    assert position(LANSING, order=order) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({3: (ASCII, "E")}, (42.7325, 84.5556, 262.5)),
        ({1: (ASCII, "s"), 3: (ASCII, "w")}, (-42.7325, -84.5556, 262.5)),
        ({1: (ASCII, "S"), 3: (ASCII, "E")}, (-42.7325, 84.5556, 262.5)),
        ({2: (RATIONAL, [(10, 1), (3075, 100), (0, 1)])}, (10 + 30.75 / 60, -84.5556, 262.5)),
        ({5: (BYTE, b"\1")}, (42.7325, -84.5556, -262.5)),  # below sea level
    ],
)
def test_hemispheres_fractions_and_heights(change, expected, position):
    assert position(LANSING | change) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    "change",
    [
        *({tag: None} for tag in (1, 2, 3, 4)),
        {2: (RATIONAL, [(42, 1), (43, 1), (0, 0)])},
        {4: (RATIONAL, [(84, 0), (33, 1), (20, 1)])},
        {1: (ASCII, "")},
        {3: (ASCII, "X")},
        {2: (RATIONAL, [(91, 1), (0, 1), (0, 1)])},
        {4: (RATIONAL, [(181, 1), (0, 1), (0, 1)])},
        {9: (ASCII, "V")},
        {2: (RATIONAL, [(0, 1)] * 3), 4: (RATIONAL, [(0, 1)] * 3)},
    ],
)
def test_a_position_of_which_a_part_is_not_known_is_none(change, position):
    stated = {tag: value for tag, value in (LANSING | change).items() if value}
    assert position(stated) == (None, None, None)


@pytest.mark.parametrize("change", [{6: (RATIONAL, (100, 0))}, {6: (RATIONAL, (4_000_000_000, 1))}])
def test_a_height_that_is_not_known_leaves_the_position(change, position):
    found = position(LANSING | change)
    assert found[0] == pytest.approx(42.7325, abs=1e-9)
    assert found[2] is None


def test_a_directory_outside_the_file_is_no_position(save):
    path = save(make_dng(make_samples(32, 48, 16), Variant(main={34853: (LONG, 1 << 30)})))
    assert reader.read_header(path).latitude_deg is None


def test_bands_follow_the_tiles_from_the_visible_corner(save):
    tiled = Variant(compression="ljpeg", bits=12, tile=(16, 16))
    samples = make_samples(48, 48, 12)
    whole = reader.read_header(save(make_dng(samples, tiled)))
    cut = replace(tiled, active_area=(20, 4, 44, 44))
    inner = reader.read_header(save(make_dng(samples, cut), "b.dng"))
    assert (whole.band_rows, whole.first_band_rows) == (16, 16)
    assert (inner.band_rows, inner.first_band_rows) == (16, 12)


DJI = """<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
<rdf:Description rdf:about="DJI Meta Data" xmlns:drone-dji="http://www.dji.com/drone-dji/1.0/"
 drone-dji:RelativeAltitude="+50.10" drone-dji:GimbalRollDegree="+0.00" drone-dji:GimbalYawDegree="-12.30"
 drone-dji:GimbalPitchDegree="-89.90" drone-dji:FlightYawDegree="{yaw}"/></rdf:RDF></x:xmpmeta>"""


@pytest.fixture
def angles_of(save):
    def read(xmp):
        header = reader.read_header(save(make_tiff(xmp), "picture.tif"))
        return {angle.name: angle.value for angle in header.attitude}

    return read


def test_a_gimbal_s_and_its_aircraft_s(angles_of):
    assert angles_of(DJI.format(yaw="+171.20")) == {
        "drone-dji:GimbalYawDegree": -12.3,
        "drone-dji:GimbalPitchDegree": -89.9,
        "drone-dji:GimbalRollDegree": 0.0,
        "drone-dji:FlightYawDegree": 171.2,
    }


@pytest.mark.parametrize("yaw", ["nan", "inf", "1e9", "", "north", "12,5", "&lt;b&gt;"])
def test_what_is_no_angle_is_left_out(angles_of, yaw):
    found = angles_of(DJI.format(yaw=yaw))
    assert (len(found), "drone-dji:FlightYawDegree" in found) == (3, False)
    assert [angles_of(xmp) for xmp in (" ", "<x", "<!DOCTYPE x><x/>")] == [{}] * 3


@pytest.mark.parametrize(
    ("name", "angles"),
    [
        (
            "sequoia/IMG_180413_080658_0000_GRE.TIF",
            {"camera:Yaw": -63.782867, "camera:Pitch": 0.457283, "camera:Roll": 1.283353},
        ),
        (
            "rededge/0000SET_000_IMG_0001_4.tif",
            {
                "camera:IrradianceYaw": -21.110888465668392,
                "camera:IrradiancePitch": -0.552849606695601,
                "camera:IrradianceRoll": -1.5354035422683689,
                "dls:Yaw": -0.36845451174720734,
                "dls:Pitch": -0.009649045905193925,
                "dls:Roll": -0.026797847159366964,
            },
        ),
    ],
)
def test_real_files(name, angles):
    assert {each.name: each.value for each in reader.read_header(data_file(name)).attitude} == angles
