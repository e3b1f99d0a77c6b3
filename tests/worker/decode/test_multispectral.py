"""What is read of a Sequoia's and a MicaSense camera's files, whole, old, new and broken."""

import base64
import dataclasses
import json
import tempfile
from datetime import datetime
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from radiometry.frame.multispectral import GainMeasurement
from tests.support import reader
from tests.worker.decode.spectral_tiff import (
    CALIBRATION,
    make_tiff,
    pack_records,
    write_micasense_xmp,
    write_sequoia_xmp,
)
from worker.decode.dialects.sequoia import read_counts, read_gains
from worker.decode.metadata import MAX_BYTES, MAX_DEPTH, MAX_PROPERTIES, MAX_TEXT_BYTES, parse_xmp
from worker.decode.pool import DecoderPool

# SensorModel, then CH0 of the ten records.
SEQUOIA = {
    "GRE": ("green", 550.0, (310316.1, 3067.5, 4773.6), {34}),
    "RED": ("red", 660.0, (280652.5, 4863.1, 2764.2), {28}),
    "REG": ("red_edge", 735.0, (78630.0, 5078.8, 623.5), {5, 6}),
    "NIR": ("nir", 790.0, (271665.8, 5008.3, 2581.1), {14}),
}
ONE_RECORD = pack_records("<QHHHHfff", [(10**8, 34, 2, 1, 100, 1, 2, 3)])
LAYOUTS = {28: "<QHHHHfff", 24: "<QHHfff", 20: "<QHHff"}


def read(save, xmp, **tiff):
    return reader.read_header(save(make_tiff(xmp, **tiff), "band.tif"))


@pytest.mark.parametrize("suffix", SEQUOIA)
def test_real_sequoia_files(real_files, suffix):
    band, wavelength_nm, model, counts = SEQUOIA[suffix]
    header = reader.read_header(real_files / "sequoia" / f"IMG_180413_080658_0000_{suffix}.TIF")
    found = header.multispectral
    assert (found.system, found.band, found.wavelength_nm) == ("sequoia", band, wavelength_nm)
    assert (found.sensor_model.a, found.sensor_model.b, found.sensor_model.c) == model
    assert (header.rendered, header.cfa, header.serial) == (False, "grey", "PI040378AA6C000181")
    assert found.sunshine_serial == "PI040379AA6E000358"
    assert found.capture_id == "BE5AB0ABA969E1CB424A394AA2FD3208"
    assert (header.exposure_time_s, header.f_number) == pytest.approx((0.003, 2.2), rel=1e-6)
    assert (found.counts.record_bytes, len(found.counts.records)) == (28, 10)
    assert {record.ch0 for record in found.counts.records} == counts
    assert {(r.gain_index, r.integration_time_s) for r in found.counts.records} == {(1, 0.1)}
    assert len(found.counts.gains) == 4
    # the sensor has ten bits, at the upper end of sixteen: its brightest is not 65535
    assert (header.white_level_dn, header.white_level_origin) == ((65472.0,), "camera")
    # the last reading was taken 0.14 s before the exposure, on one clock
    assert found.exposed_at_us - found.counts.records[-1].time_us == 137_863


def test_real_sequoia_levels_are_the_brightest_numbers_there_are(real_files):
    """Three of the four bands are clipped somewhere, and none reaches 65535."""
    largest = [
        int(reader.read_window(path, 0, 0, 960, 1280).samples_dn.max())
        for path in sorted((real_files / "sequoia").glob("*.TIF"))
    ]
    assert largest == [65472, 65472, 65472, 61376]


def test_real_rededge_files(real_files):
    header = reader.read_header(real_files / "rededge" / "0000SET_000_IMG_0000_5.tif")
    found = header.multispectral
    assert (found.system, found.band, found.rig_camera_index) == ("micasense", "red_edge", 4)
    assert (found.wavelength_nm, found.width_nm) == (717.0, 10.0)
    assert found.radial_vignetting.centre_x_px == 645.98549505058588
    assert found.radial_vignetting.coefficients[-1] == 1.8103503568176496e-17
    assert found.irradiance.irradiance_w_m2_nm == 0.77133029699325562
    assert (found.irradiance.quantity, found.irradiance.unit_origin) == ("spectral", "dls1")
    assert found.sunshine_serial == "DL03-1706120-SC"
    assert header.black_level_dn == (4800.0,)
    assert header.white_level_dn == (65520.0,)
    assert header.latitude_deg == pytest.approx(36.576096)
    assert found.geometry.rotation_deg is None


def test_captures_of_a_real_rededge_have_one_clock_and_name_their_bands_alike(real_files):
    """Two captures, 395 and 486 s after the start and 91 s apart: no jump."""
    headers = [reader.read_header(path) for path in sorted((real_files / "rededge").glob("*.tif"))]
    told = [header.multispectral for header in headers]
    assert [each.exposed_at_us for each in told] == [395_000_000] * 5 + [486_000_000] * 5
    assert [each.capture_id for each in told] == ["5v25BtsZg3BQBhVH7Iaz"] * 5 + ["g2R43Qr5m7EeTFGbkh1W"] * 5
    assert {each.flight_id for each in told} == {"NtLNbVIdowuCaWYbg3ck"}
    starts = [datetime.fromisoformat(each.taken_at).timestamp() for each in headers]
    assert starts[5] - starts[0] == pytest.approx(91.0, abs=0.1)


def test_a_header_comes_through_the_pool_whole(real_files):
    path = real_files / "sequoia" / "IMG_180413_080658_0000_NIR.TIF"
    with DecoderPool() as pool:
        assert pool.read_header(path) == reader.read_header(path)


def test_old_dump_of_24_byte_records(real_files):
    """As kept it carries one letter too many, a D in the first record: as it stands it decodes to nothing."""
    text = (real_files / "sequoia" / "old_firmware_irradiance_list.txt").read_text()
    assert "none of the known lengths" in read_counts(text, ())
    at = text.index("AjsBDQdu") + len("AjsB")
    counts = read_counts(text[:at] + text[at + 1 :], ())
    assert (counts.record_bytes, counts.cut_short, len(counts.records)) == (24, True, 22)
    assert counts.records[0].gain_index is counts.records[0].integration_time_s is None
    # the first two as the forum printed them
    printed = read_counts(".5eVMCgAAAABsAjsBQduXwlohccAbtyTA\naPRPCgAAAABsAjsBDbmYwr5FUcA4VpG/.", ())
    assert (printed.record_bytes, printed.cut_short) == (24, False)
    assert printed.records == counts.records[:2]
    rows = [(r.time_us, r.ch0, r.ch1, r.yaw_deg, r.pitch_deg, r.roll_deg) for r in printed.records]
    assert rows[0] == pytest.approx((172811749, 620, 315, -75.928, -3.768, -2.574), abs=5e-4)
    assert rows[1] == pytest.approx((173012072, 620, 315, -76.361, -3.270, -1.135), abs=5e-4)


@pytest.mark.parametrize("size", LAYOUTS)
@given(
    start=st.integers(0, 10**11),
    steps=st.lists(st.integers(150_000, 260_000), min_size=1, max_size=40),
    counts=st.tuples(st.integers(0, 65535), st.integers(0, 65535)),
    gain=st.integers(0, 3),
    angle=st.floats(-180, 180, width=32),
    cut=st.integers(0, 19),
)
def test_records_are_told_apart_by_length_and_times(size, start, steps, counts, gain, angle, cut):
    rows, time = [], start
    for step in [0, *steps]:
        time += step
        rest = (gain, 100, angle, 1.0, -2.0) if size == 28 else (angle, 1.0, -2.0)[: (size - 16) // 4 + 1]
        rows.append((time, *counts, *(rest if size != 20 else rest[:2])))
    text = pack_records(LAYOUTS[size], rows)
    found = read_counts(text, ())
    assert (found.record_bytes, found.cut_short) == (size, False)
    assert [r.time_us for r in found.records] == [row[0] for row in rows]
    assert {(r.ch0, r.ch1, r.yaw_deg) for r in found.records} == {(*counts, angle)}
    assert {r.gain_index for r in found.records} == {gain if size == 28 else None}
    # a handful of cut records can look like another layout's; a list as cameras write it cannot
    if cut and len(rows) > 8:
        short = read_counts(text[: -4 * ((cut + 2) // 3)], ())
        assert short.record_bytes == size
        assert [r.time_us for r in short.records] == [row[0] for row in rows[: len(short.records)]]


@given(st.binary(max_size=2000))
def test_any_bytes_are_a_list_or_a_reason(raw):
    found = read_counts(base64.b64encode(raw).decode(), ())
    if not isinstance(found, str):
        times = [record.time_us for record in found.records]
        assert times == sorted(times)


@pytest.mark.parametrize("text", ["", "....", "!!!!", "AAA", "é" * 40])
def test_what_is_no_base64_is_a_reason(text):
    assert "IrradianceList" in read_counts(text, ())


def test_gain_table_is_rows_of_four_counts():
    gains = read_gains([float(word) for word in CALIBRATION.split(",")])
    assert gains[2] == GainMeasurement(gain_index=2, integration_time_s=0.6, ch0=3990, ch1=1506)
    assert len(gains) == 4
    for broken in ([0, 600, 11], [0, 600, 11, 3.5], [0, 600, 11, -3], [0, 600, 11, 70000]):
        assert read_gains(broken) == ()


def test_small_sequoia_file(save):
    header = read(save, write_sequoia_xmp(IrradianceList=ONE_RECORD))
    found = header.multispectral
    assert (found.band, found.band_name, found.capture_id) == ("green", "Green", "BE5AB0AB")
    assert found.vignetting_polynomial.exponents == ((0, 0), (1, 0), (0, 1))
    assert found.vignetting_polynomial.coefficients == (0.9, 0.05, -0.1)
    assert found.counts.records[0].ch0 == 34
    assert found.sunshine_missing == ""
    assert found.exposed_at_us == 150_128_607
    assert (header.rendered, header.cfa) == (False, "grey")


def test_a_known_band_is_raw_without_a_black_level_too(save):
    assert not read(save, write_sequoia_xmp(), black=False).rendered
    assert read(save, "no xml", black=False).rendered
    assert read(save, write_sequoia_xmp(SensorModel=None), make="Other").multispectral is None
    assert read(save, "", make="Parrot").multispectral is None


def test_sunshine_data_and_its_calibration_may_be_absent(save):
    uncalibrated = {"IrradianceCalibrationMeasurement": None}
    found = read(save, write_sequoia_xmp(**uncalibrated)).multispectral
    assert found.counts is None
    assert "no sunshine sensor was connected" in found.sunshine_missing
    xmp = write_sequoia_xmp(IrradianceList=ONE_RECORD, **uncalibrated)
    found = read(save, xmp, software="v1.7.0").multispectral
    assert (found.counts.gains, len(found.counts.records)) == ((), 1)


@pytest.mark.parametrize(
    ("changes", "gone"),
    [
        ({"SensorModel": "1e400,2,3"}, "sensor_model"),
        ({"SensorModel": "a,b,c"}, "sensor_model"),
        ({"VignettingPolynomial2DName": "0,0,1,0,0,-1"}, "vignetting_polynomial"),
        ({"VignettingPolynomial2DName": "0,0,1,0,0,1e6"}, "vignetting_polynomial"),
        ({"CentralWavelength": "inf"}, "wavelength_nm"),
        ({"RigCameraIndex": "-1"}, "rig_camera_index"),
    ],
)
def test_nonsense_reads_as_nothing(save, changes, gone):
    assert getattr(read(save, write_sequoia_xmp(**changes)).multispectral, gone) is None


GENERATIONS = [
    ({"SpectralIrradiance": "1.25"}, "v2.1.2", (1.25, "spectral", "dls1")),
    ({"SpectralIrradiance": "125", "HorizontalIrradiance": "110"}, "v5.1.7", (1.10, "horizontal", "dls2")),
    ({"SpectralIrradiance": "125", "HorizontalIrradiance": "110"}, "v5.1.6", (1.25, "spectral", "dls2")),
    (
        {"HorizontalIrradiance": "110", "IrradianceScaleToSIUnits": "0.01"},
        "v7.0.0",
        (1.10, "horizontal", "tag"),
    ),
    ({"SpectralIrradiance": "1.25", "IrradianceScaleToSIUnits": "1.0"}, "v2.0.0", (1.25, "spectral", "tag")),
]


@pytest.mark.parametrize(("dls", "software", "expected"), GENERATIONS)
def test_light_sensor_generations_differ_by_a_hundred(save, dls, software, expected):
    xmp = write_micasense_xmp(**dls)
    found = read(save, xmp, make="MicaSense", model="RedEdge-M", software=software).multispectral
    told = found.irradiance
    assert told.irradiance_w_m2_nm == pytest.approx(expected[0])
    assert (told.quantity, told.unit_origin) == expected[1:]
    assert found.sunshine_missing == ""


@pytest.mark.parametrize("value", ["0", "-1", "nan", ""])
def test_light_sensor_without_light_is_missing(save, value):
    found = read(save, write_micasense_xmp(SpectralIrradiance=value), make="MicaSense").multispectral
    assert found.irradiance is None
    assert "light sensor" in found.sunshine_missing


def plain(body):
    return f'<x xmlns:c="http://pix4d.com/1.0">{body}</x>'.encode()


def named(doctype, band="Red"):
    return f"<!DOCTYPE x {doctype}>".encode() + plain(f"<c:BandName>{band}</c:BandName>")


def test_plain_packet_is_read():
    assert parse_xmp(plain("<c:BandName>Red</c:BandName>")) == {"camera:BandName": ("Red",)}


@pytest.mark.parametrize(
    "packet",
    [
        named('[<!ENTITY a "lol"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]', "&b;"),
        named('[<!ENTITY e SYSTEM "file:///etc/passwd">]', "&e;"),
        named(""),
        plain("<c:a>" * MAX_DEPTH + "</c:a>" * MAX_DEPTH),
        plain("<c:a/>" * MAX_PROPERTIES),
        plain("<c:a " + " ".join(f'a{n}="1"' for n in range(MAX_PROPERTIES)) + "/>"),
        plain("<c:a>" + "1" * (MAX_TEXT_BYTES + 1) + "</c:a>"),
        plain("<c:a>" + " " * MAX_BYTES + "1</c:a>"),
        plain("<c:a>"),
        plain("<c:a>\xff</c:a>").replace("\xff".encode(), b"\xff"),
        b"\xfe\xff\x00<",
    ],
    ids=[
        *("laughs", "outside", "doctype", "deep", "many", "attributes", "long", "large", "unclosed"),
        *("encoding", "utf16"),
    ],
)
def test_document_types_and_packets_beyond_the_bounds_are_none(packet):
    assert parse_xmp(packet) == {}


@given(st.binary(max_size=400), st.integers(0, 2000), st.integers(0, 30))
def test_a_damaged_packet_makes_no_file_unreadable(garbage, at, cut):
    xmp = write_sequoia_xmp().encode()
    at = min(at, len(xmp))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "band.tif"
        path.write_bytes(make_tiff(xmp[:at] + garbage + xmp[at + cut :]))
        header = reader.read_header(path)
    json.dumps(dataclasses.asdict(header), allow_nan=False)
