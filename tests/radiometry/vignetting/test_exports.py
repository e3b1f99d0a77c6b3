"""The falloff in other programs' terms, read back as they read it."""

import dataclasses
import struct
import xml.etree.ElementTree as ET

import numpy as np
import pytest
import scipy

from radiometry.findings import InputRejected
from radiometry.vignetting import application, dng, gain_map
from radiometry.vignetting import lensfun as vignetting_lensfun
from radiometry.vignetting.correction import compute_correction
from radiometry.vignetting.xmp import export_xmp
from simulation.flats import FALLOFFS
from tests.radiometry.vignetting.flats import coefficient

HEIGHT, WIDTH = 300, 400
WIDE = coefficient(k1=FALLOFFS[1.4][0], k2=FALLOFFS[1.4][1], k3=FALLOFFS[1.4][2], f_number=1.4)
LENS = (WIDE, coefficient(f_number=4.0, k1=-0.085, k2=0.02, k3=-0.015))
CENTRED = tuple(dataclasses.replace(each, centre_row_px=149.5, centre_col_px=199.5) for each in LENS)
NAMES = vignetting_lensfun.LensfunNames(
    camera_make="Maker & Sons",
    camera_model="Flyer One",
    lens_make="Optics",
    lens_model="Summer 15mm f/1.4",
    mount="flyerOne",
    focal_length_mm=15.0,
    sensor_width_mm=17.3,
    sensor_height_mm=12.975,
)
# The order in which the schema of Lensfun's database wants the children of each element.
CHILDREN = {
    "lensdatabase": ["mount", "camera", "lens"],
    "mount": ["name", "compat"],
    "camera": ["maker", "model", "mount", "cropfactor"],
    "lens": ["maker", "model", "mount", "focal", "aperture", "cropfactor", "aspect-ratio", "calibration"],
}


def share(lens, f_number=1.4):
    rows, cols = np.mgrid[0:HEIGHT, 0:WIDTH].astype(float)
    return application.evaluate(lens, rows, cols, channel="G1", f_number=f_number).share


def export(lens, names=NAMES):
    return vignetting_lensfun.export_lensfun(lens, channels=("G1",), names=names)


def elements(text):
    return ET.fromstring(text).findall("lens/calibration/vignetting")


def error_in(text):
    """The largest error that the first comment states."""
    return float(text.partition("about the middle ")[2].partition("%")[0]) / 100


def test_opcode_undoes_the_falloff_as_the_specification_reads_it():
    found = dng.export_dng(LENS, channels=("G1",), f_number=1.4)
    count, opcode, version, flags, size, *numbers = struct.unpack(">5I7d", found.opcode_list)
    assert (count, opcode, version, flags, size) == (1, 3, 0x01030000, 1, 56)
    assert tuple(numbers[:5]) == found.k
    centre_x, centre_y = numbers[5:]
    assert (centre_x, centre_y) == pytest.approx((200 / 399, 100 / 299))
    x, y = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    x0, y0 = centre_x * (WIDTH - 1), centre_y * (HEIGHT - 1)
    farthest = np.hypot(max(x0, WIDTH - 1 - x0), max(y0, HEIGHT - 1 - y0))
    squared = ((x - x0) ** 2 + (y - y0) ** 2) / farthest**2
    gain = 1 + sum(k * squared ** (n + 1) for n, k in enumerate(numbers[:5]))
    error = np.abs(gain * share(LENS) - 1).max()
    assert error == pytest.approx(found.largest_error_rel, rel=0.05)
    assert error < 0.006  # with 63 % of the light lost in the farthest corner


def test_sidecar_is_the_curve_of_its_channel_as_micasense_reads_it():
    named = {each.tag.partition("}")[2]: each for each in ET.fromstring(export_xmp(WIDE)).iter()}
    x0, y0 = (float(each.text) for each in named["VignettingCenter"][0])
    terms = [float(each.text) for each in named["VignettingPolynomial"][0]]
    x, y = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    r = np.hypot(x - x0, y - y0)
    read = np.polyval([*reversed(terms), 1.0], r)
    assert np.abs(read / share((WIDE,)) - 1).max() < 1e-12


def test_opcode_between_f_numbers_and_outside_of_what_it_can_say():
    found = dng.export_dng(LENS, channels=("G1",), f_number=2.0)
    assert found.largest_error_rel < 0.003
    far = [dataclasses.replace(each, centre_col_px=-5.0) for each in LENS]
    with pytest.raises(InputRejected, match="outside of the frame"):
        dng.export_dng(far, channels=("G1",), f_number=1.4)
    with pytest.raises(InputRejected, match="No channel"):
        dng.export_dng(LENS, channels=(), f_number=1.4)


def read_gain_maps(opcodes):
    """Gain of every pixel, as the specification reads it: pixel n of m lies at (n + 0.5) / m of the side."""
    gains, at = np.zeros((HEIGHT, WIDTH)), 4
    for _ in range(int.from_bytes(opcodes[:4], "big")):
        number, _, _, size = struct.unpack_from(">4I", opcodes, at)
        numbers = struct.unpack_from(">10I4dI", opcodes, at + 16)
        top, left, bottom, right, plane, planes, row_pitch, col_pitch, rows, cols = numbers[:10]
        assert (number, bottom, right, plane, planes, numbers[14]) == (9, HEIGHT, WIDTH, 0, 1, 1)
        assert size == 76 + 4 * rows * cols
        held = np.frombuffer(opcodes, ">f4", rows * cols, at + 16 + 76).reshape(rows, cols)
        places = []
        for first, step, side, spacing, origin in (
            (top, row_pitch, HEIGHT, numbers[10], numbers[12]),
            (left, col_pitch, WIDTH, numbers[11], numbers[13]),
        ):
            places.append(((np.arange(first, side, step) + 0.5) / side - origin) / spacing)
        lattice = np.meshgrid(*places, indexing="ij")
        gains[top::row_pitch, left::col_pitch] = scipy.ndimage.map_coordinates(
            held.astype(float), lattice, order=1
        )
        at += 16 + size
    assert at == len(opcodes)
    return gains


def test_gain_maps_undo_the_falloff_of_each_channel_as_the_specification_reads_them():
    outside = {"centre_col_px": -5.0, "k1": -0.2, "k2": 0.02, "k3": 0.0}
    changes = {"R": {}, "G1": outside, "G2": {"k1": -0.5}, "B": {"centre_row_px": 120.0}}
    lens = [dataclasses.replace(WIDE, channel=channel, **change) for channel, change in changes.items()]
    found = gain_map.export_gain_map(lens, cfa="RGGB", f_number=1.4)
    wanted = compute_correction(lens, cfa="RGGB", f_number=1.4)
    error = np.abs(read_gain_maps(found.opcode_list) / wanted - 1).max()
    assert found.largest_error_rel == pytest.approx(error, rel=0.2)
    assert error < 2e-3
    grey = gain_map.export_gain_map(LENS, cfa="grey", f_number=4.0)
    assert np.abs(read_gain_maps(grey.opcode_list) * share(LENS, 4.0) - 1).max() < 1e-4
    with pytest.raises(InputRejected, match="rendered"):
        gain_map.export_gain_map(LENS, cfa="rgb", f_number=1.4)


def test_lensfun_s_schema_is_kept():
    root = ET.fromstring(export(LENS))
    assert (root.tag, root.attrib) == ("lensdatabase", {"version": "1"})
    for tag, children in CHILDREN.items():
        (element,) = root.iter(tag) if tag != "mount" else [root.find("mount")]
        assert [child.tag for child in element] == children
    assert root.findtext("camera/maker") == "Maker & Sons"
    assert float(root.findtext("lens/cropfactor")) == pytest.approx(43.2666 / 21.625, rel=1e-4)
    assert root.findtext("lens/aspect-ratio") == "400:300"
    for element, f_number in zip(elements(export(LENS)), (1.4, 4.0), strict=True):
        assert set(element.attrib) == {"model", "focal", "aperture", "distance", "k1", "k2", "k3"}
        assert (element.get("model"), float(element.get("aperture"))) == ("pa", f_number)
        assert (float(element.get("focal")), float(element.get("distance"))) == (15.0, 1000.0)


def test_a_centred_lens_loses_nothing_and_another_says_what():
    element = elements(export(CENTRED))[0]
    # r is 1 at the centre of the corner pixel, not at the corner itself
    ratio = (299**2 + 399**2) / 500**2
    for name, k, power in zip(("k1", "k2", "k3"), WIDE.k, (1, 2, 3), strict=True):
        assert float(element.get(name)) == pytest.approx(k * ratio**power, rel=1e-6)
    assert error_in(export(CENTRED)) == 0.0
    assert error_in(export(LENS)) > 0.05


def test_names_that_the_schema_would_refuse():
    with pytest.raises(ValueError, match="positive"):
        dataclasses.replace(NAMES, focal_length_mm=0.0)
    with pytest.raises(ValueError, match="names"):
        dataclasses.replace(NAMES, mount="")
    with pytest.raises(InputRejected, match="type the name again"):
        export(LENS, dataclasses.replace(NAMES, camera_model="A\x00B"))
    # an ideographic space, which Python does not count as printable
    maker = "光学\u3000株式会社"
    assert (
        ET.fromstring(export(LENS, dataclasses.replace(NAMES, lens_make=maker))).findtext("lens/maker")
        == maker
    )


@pytest.mark.parametrize("f_number", [1.4, 4.0])
def test_liblensfun_reads_the_file_and_corrects_by_it(lensfunpy, f_number):
    database = lensfunpy.Database(xml=export(CENTRED), load_common=False, load_bundled=False)
    (camera,) = database.find_cameras("Maker & Sons", "Flyer One")
    (lens,) = database.find_lenses(camera, "Optics", "Summer 15mm f/1.4")
    modifier = lensfunpy.Modifier(lens, camera.crop_factor, WIDTH, HEIGHT)
    modifier.initialize(15.0, f_number, 1000.0, pixel_format=np.float32)
    pixels = np.repeat(share(CENTRED, f_number).astype(np.float32)[..., None], 3, axis=2)
    assert modifier.apply_color_modification(pixels)
    assert np.abs(pixels - 1).max() < 2e-5
