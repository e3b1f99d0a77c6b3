"""The falloff in other programs' terms, read back as they read it."""

import dataclasses
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from radiometry.findings import InputRejected
from radiometry.specification.exports import LensfunNames
from radiometry.vignetting import lens as vignetting_lens
from simulation.targets import FALLOFFS
from tests.radiometry.vignetting.flats import coefficient

HEIGHT, WIDTH = 300, 400
WIDE = coefficient(k1=FALLOFFS[1.4][0], k2=FALLOFFS[1.4][1], k3=FALLOFFS[1.4][2], f_number=1.4)
LENS = (WIDE, coefficient(f_number=4.0, k1=-0.085, k2=0.02, k3=-0.015))
CENTRED = tuple(dataclasses.replace(each, centre_row_px=149.5, centre_col_px=199.5) for each in LENS)
NAMES = LensfunNames(
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
    return vignetting_lens.evaluate(lens, rows, cols, channel="G1", f_number=f_number).share


def export(lens, names=NAMES):
    return vignetting_lens.export_lensfun(lens, channels=("G1",), names=names)


def elements(text):
    return ET.fromstring(text).findall("lens/calibration/vignetting")


def error_in(text):
    """The largest error that the first comment states."""
    return float(text.partition("about the middle ")[2].partition("%")[0]) / 100


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
