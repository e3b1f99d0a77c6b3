"""Frames in blocks: figures worked out by hand, borders, regions, windows, transposition, JSON."""

import math
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest

from radiometry.findings import InputRejected
from radiometry.fitting.evidence import Region
from radiometry.frame.packing import unpack
from radiometry.frame.roi import Polygon
from radiometry.specification.exports import LensfunNames
from radiometry.vignetting import fit as vignetting
from radiometry.vignetting import lens as vignetting_lens
from radiometry.vignetting.blocks import Grid, Radial, Site, extract_features
from radiometry.vignetting.channels import fit_channel
from radiometry.vignetting.falloff import DarkError
from radiometry.vignetting.light import estimate_dark_drift, estimate_dark_error, merge_dark_errors
from simulation.camera import change, take
from simulation.targets import FALLOFFS, plan_flat
from tests.radiometry.frames import frame_of
from tests.radiometry.vignetting.flats import NONE, SMALL, coefficient, dark, exact_blocks, flat, row, whole


def make_frame(samples, cfa="RGGB"):
    return frame_of(samples, cfa=cfa, black=(10.0, 11.0, 12.0, 13.0), white=(4095.0,) * 4)


@pytest.fixture(scope="module")
def header():
    return take(SMALL, plan_flat(SMALL, f_number=8.0), np.random.default_rng(0)).header


def extract(frame, header, *polygons):
    regions = [Region(name="", polygon=Polygon.from_points(each)) for each in polygons]
    regions = regions or [whole(frame.height_px, frame.width_px)]
    return extract_features(frame, regions, header=header).features


def by_name(features):
    return {each.channel: each for each in features.channels}


def test_each_channel_is_averaged_by_itself(header):
    samples = np.zeros((18, 20))
    samples[0::2, 0::2], samples[0::2, 1::2], samples[1::2, 0::2], samples[1::2, 1::2] = 100, 200, 300, 400
    samples[0, 0] = 132  # one of the 16 reds of the first block: +2 in its mean
    found = by_name(extract(make_frame(samples), header))
    assert list(found) == ["R", "G1", "G2", "B"]
    red = unpack(found["R"].mean_dn)
    assert red.shape == (3, 3)
    assert red[0, 0] == 102.0
    assert (red.ravel()[1:] == 100.0).all()
    for name, level in (("G1", 200.0), ("G2", 300.0), ("B", 400.0)):
        assert (unpack(found[name].mean_dn) == level).all()
    assert [found[name].black_level_dn for name in found] == [10.0, 11.0, 12.0, 13.0]
    # blocks of 8: 16 pixels of a channel, 8 x 4 and 4 x 2 and less at the far borders
    assert unpack(found["R"].n).tolist() == [[16, 16, 8], [16, 16, 8], [4, 4, 2]]
    # two of its 24 differences are 32: sqrt(2 * 32^2 / (2 * 24))
    assert unpack(found["R"].noise_dn)[0, 0] == pytest.approx(np.sqrt(2 * 32**2 / 48), rel=1e-6)


@pytest.mark.parametrize(("cfa", "greens"), [("GRBG", (0, 3)), ("BGGR", (2, 1)), ("GBRG", (3, 0))])
def test_a_green_is_g1_in_a_row_with_red(header, cfa, greens):
    samples = np.tile([[0, 1], [2, 3]], (8, 8))
    found = by_name(extract(make_frame(samples, cfa), header))
    assert [unpack(found[name].mean_dn)[0, 0] for name in ("G1", "G2")] == list(greens)


def test_noise_ignores_a_slope_of_the_light(header):
    random = np.random.default_rng(4)
    slope = 1000 + 3.0 * np.arange(512)[:, None] + 2.0 * np.arange(512)[None, :]
    samples = np.round(slope + 20.0 * random.standard_normal((512, 512)))
    (grey,) = extract(make_frame(samples, "grey"), header).channels
    noise = unpack(grey.noise_dn)
    assert noise.shape == (64, 64)
    # d^2 holds the slope twice: sqrt(400 + (9 + 4) / 4); 4096 blocks of about 64 pixels fix it to 0.2 %
    assert np.sqrt(np.mean(noise**2)) == pytest.approx(np.sqrt(400 + 13 / 4 + 1 / 12), rel=0.01)
    assert samples[:8, :8].std() > 20.5  # what the plain deviation of a block would say


def test_clipped_samples_are_counted(header):
    samples = np.full((16, 16), 500)
    samples[0, :4] = 4095
    (grey,) = extract(make_frame(samples, "grey"), header).channels
    assert unpack(grey.clipped_share).tolist() == [[4 / 64, 0.0], [0.0, 0.0]]


def test_a_region_keeps_only_its_whole_blocks(header):
    samples = np.arange(24 * 32).reshape(24, 32)
    (grey,) = extract(make_frame(samples, "grey"), header, [(8, 0), (32, 0), (32, 20), (8, 20)]).channels
    assert unpack(grey.n).tolist() == [[0, 64, 64, 64], [0, 64, 64, 64], [0, 0, 0, 0]]
    assert unpack(grey.mean_dn)[0, 0] == 0.0
    with pytest.raises(InputRejected, match="whole block of 8 x 8"):
        extract(make_frame(samples, "grey"), header, [(1, 1), (7, 1), (7, 7), (1, 7)])


def test_a_window_says_what_the_whole_frame_says_there(header):
    random = np.random.default_rng(5)
    samples = random.integers(100, 900, (40, 56))
    polygon = [(8, 16), (48, 16), (48, 32), (8, 32)]
    frame = make_frame(samples)
    window = replace(frame, samples_dn=frame.samples_dn[15:33, 7:49], row0=15, col0=7)
    assert extract(window, header, polygon) == extract(frame, header, polygon)


def test_a_rendered_picture_has_three_planes():
    lens = change(SMALL, cfa="rgb")
    features = row(take(lens, plan_flat(lens, f_number=8.0), np.random.default_rng(1))).features
    assert [each.channel for each in features.channels] == ["R", "G", "B"]
    levels = [np.median(unpack(each.mean_dn)) - 256.0 for each in features.channels]
    assert levels[0] / levels[1] == pytest.approx(0.6, rel=0.01)


def test_a_large_frame_has_at_most_64_blocks():
    grid = Grid.over(3648, 5472)
    assert grid.block_px == 86
    rows, cols = grid.axes(Site(row0=1, col0=0, step=2))
    assert (rows.starts.size, cols.starts.size) == (43, 64)
    assert rows.positions[0] == 1.0


def test_block_means_and_slopes_are_those_of_the_pixels():
    grid = Grid.over(20, 30)
    rows, cols = grid.axes(Site(row0=1, col0=0, step=2))
    centre, radius = (7.3, 18.1), grid.half_diagonal_px

    def average(row, col):
        return Radial(rows, cols, centre_row_px=row, centre_col_px=col, radius_px=radius)

    found = average(*centre)
    squared = (np.arange(9, 17, 2)[:, None] - 7.3) ** 2 + (np.arange(16, 24, 2)[None, :] - 18.1) ** 2
    for power in (1, 2, 3):
        pixels = (squared / radius**2) ** power
        assert found.means[power - 1][1, 2] == pytest.approx(pixels.mean(), rel=1e-12)
    step = 1e-5
    by_row = average(7.3 + step, 18.1).means - average(7.3 - step, 18.1).means
    by_col = average(7.3, 18.1 + step).means - average(7.3, 18.1 - step).means
    for slopes, moved in zip(found.slopes, (by_row, by_col), strict=True):
        np.testing.assert_allclose(slopes, moved / (2 * step), rtol=1e-5, atol=1e-9)


# --- The error of the dark level: by hand, through the fit, and against flats whose dark level is wrong


K, CENTRE = (-0.4, 0.1, -0.05), (88.0, 155.0)
GRID = Grid.over(192, 288)


def test_the_error_of_a_mean_of_dark_frames():
    """Means 256, 258, 260: s^2 = 4, of which pixel noise makes 0.1."""
    found = estimate_dark_error([256.0, 258.0, 260.0], [0.1, 0.1, 0.1], span_dn=3839.0)
    assert found.own == pytest.approx(math.sqrt(3.9))
    assert found.shared == pytest.approx(math.sqrt(4.0 / 3.0))


def test_what_one_dark_frame_cannot_show_and_what_a_file_only_states():
    one = estimate_dark_error([256.0], [0.01], span_dn=4000.0)
    assert (one.own, one.shared) == pytest.approx((0.4, math.hypot(0.4, 0.1)))
    assert estimate_dark_error([], [], span_dn=4096.0) == DarkError(shared=1.0, own=0.0)
    alike = estimate_dark_error([256.0, 256.0], [0.5, 0.5], span_dn=4000.0)
    assert (alike.own, alike.shared) == pytest.approx((0.0, 0.5))


def test_what_flats_share_adds_up_and_what_is_their_own_averages():
    errors = [DarkError(shared=0.01, own=0.03), DarkError(shared=0.02, own=0.04)]
    found = merge_dark_errors(errors, [0.5, 0.5])
    assert found.shared == pytest.approx(0.015)
    assert found.own == pytest.approx(0.025)


def offset(blocks, by):
    return replace(blocks, light=blocks.light + by)


def test_a_wrong_dark_level_shrinks_the_curve_and_leaves_the_centre():
    blocks = exact_blocks(GRID, K, CENTRE, error=1e-4)
    found = fit_channel([offset(blocks, 0.02)], f_number=2.0, channel="G1").fit.coefficient
    assert found.k == pytest.approx([k / 1.02 for k in K], rel=1e-5)
    assert found.centre_px == pytest.approx(CENTRE, abs=1e-4)


def test_dark_frames_that_wander_are_in_the_uncertainty_of_every_channel():
    """Darks at 250, 256 and 262 DN: s = 6; of their mean 6 / sqrt 3, of the flat's own 6."""
    bright = flat(SMALL, 1, 2.0)
    levels = (250.0, 256.0, 262.0)
    lenses = [change(SMALL, black_level_dn=level) for level in levels]
    wandering = [dark(lens, 10 + n, name=f"dark-{n}") for n, lens in enumerate(lenses)]
    steady = [dark(SMALL, 10 + n, name=f"dark-{n}") for n in range(3)]
    restless, calm = (vignetting.fit([bright, *each], NONE).channel_fits for each in (wandering, steady))
    assert len(restless) == 4
    for one, other in zip(restless, calm, strict=True):
        light_dn = 0.7 * 3839.0 * SMALL.sensor.colours[one.coefficient.channel[0]]
        assert one.dark_u_rel == pytest.approx(math.hypot(6.0, 6.0 / math.sqrt(3.0)) / light_dn, rel=0.03)
        assert other.dark_u_rel < 0.05 * one.dark_u_rel
        added = np.array(one.coefficient.covariance) - np.array(other.coefficient.covariance)
        k = np.array(one.coefficient.k)
        expected = one.dark_u_rel**2 * np.outer(k, k)
        scale = np.sqrt(np.diag(np.array(other.coefficient.covariance)))[:3]
        assert np.abs((added[:3, :3] - expected) / np.outer(scale, scale)).max() < 0.02


def test_the_drift_between_two_times_by_hand():
    """256 at 0.1 s and 260 DN at 0.3 s: 20 DN/s; wander 0.4 DN, so u_b = 0.4 / sqrt(0.02) DN/s."""
    two = ([0.1, 0.3], [256.0, 260.0], [1e-6, 1e-6])
    found = estimate_dark_drift(*two, apart_s=0.5, span_dn=4000.0)
    assert found == pytest.approx(0.5 * math.hypot(20.0, 0.4 / math.sqrt(0.02)))
    assert estimate_dark_drift(*two, apart_s=-0.5, span_dn=4000.0) == found
    assert estimate_dark_drift(*two, apart_s=0.0, span_dn=4000.0) == 0.0
    assert estimate_dark_drift([0.1, 0.1], [256.0, 260.0], [1.0, 1.0], apart_s=0.5, span_dn=4000.0) == 0.0
    assert estimate_dark_drift([], [], [], apart_s=0.5, span_dn=4000.0) == 0.0
    # about the line through (0.1, 256), (0.2, 259), (0.3, 260) lie -1/3, 2/3 and -1/3: s^2 = 2/3
    three = estimate_dark_drift(
        [0.1, 0.2, 0.3], [256.0, 259.0, 260.0], [0.1] * 3, apart_s=0.5, span_dn=4000.0
    )
    assert three == pytest.approx(0.5 * math.hypot(20.0, math.sqrt(2.0 / 3.0 / 0.02)))


def warm(time_s, *, per_s=200.0, seed=1):
    """A dark frame of a sensor whose level grows by so many DN a second."""
    lens = change(SMALL, black_level_dn=256.0 + per_s * time_s)
    return dark(lens, seed, name=f"dark-{time_s}-{seed}", time_s=time_s)


def test_dark_current_between_the_times_at_hand_is_in_the_uncertainty():
    """The flat of 0.01 s has darks of 0.1 s, 18 DN too high, and of 0.4 s."""
    bright = flat(SMALL, 1, 2.0)
    right = [warm(0.01, seed=seed) for seed in (1, 2)]
    long = [warm(0.1, seed=seed) for seed in (1, 2)]
    longer = [warm(0.4, seed=seed) for seed in (1, 2)]
    blind, known = (vignetting.fit([bright, *darks], NONE) for darks in (long, long + longer))
    assert "not in the uncertainty" in blind.flags[0].detail
    assert known.flags[0].detail.endswith("is in the uncertainty, from the times that there are.")
    for before, after in zip(blind.channel_fits, known.channel_fits, strict=True):
        assert after.coefficient.k == before.coefficient.k
        light_dn = 0.7 * 3839.0 * SMALL.sensor.colours[after.coefficient.channel[0]]
        assert after.dark_u_rel == pytest.approx(18.0 / light_dn, rel=0.03)
        assert before.dark_u_rel < 0.1 * after.dark_u_rel
    assert not vignetting.fit([bright, *right, *longer], NONE).flags


# --- The falloff in other programs' terms, read back as they read it


HEIGHT, WIDTH = 300, 400
WIDE = coefficient(k1=FALLOFFS[1.4][0], k2=FALLOFFS[1.4][1], k3=FALLOFFS[1.4][2], f_number=1.4)
LENS = (WIDE, coefficient(f_number=4.0, k1=-0.085, k2=0.02, k3=-0.015))
CENTRED = tuple(replace(each, centre_row_px=149.5, centre_col_px=199.5) for each in LENS)
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


def test_five_terms_of_a_wide_lens_state_what_three_lose():
    """cos^4 to 42 degrees, whose steep corner three terms do not follow."""
    rows, cols = np.mgrid[0:HEIGHT, 0:WIDTH]
    squared = ((rows - 149.5) ** 2 + (cols - 199.5) ** 2).ravel() / 250.0**2
    cos4 = (1 + squared * np.tan(np.radians(42.0)) ** 2) ** -2
    powers = squared[:, None] ** np.arange(1, 6)
    k = dict(zip(("k1", "k2", "k3", "k4", "k5"), np.linalg.lstsq(powers, cos4 - 1)[0].tolist(), strict=True))
    wide = replace(CENTRED[0], **k, covariance=tuple(map(tuple, 1e-6 * np.eye(7))))
    text = export((wide,))
    (element,) = elements(text)
    at = squared * 250.0**2 / (149.5**2 + 199.5**2)
    three = 1 + sum(float(element.get(f"k{n}")) * at**n for n in (1, 2, 3))
    five = 1 + powers @ np.array(list(k.values()))
    assert error_in(text) == pytest.approx(np.abs(three / five - 1).max(), abs=1e-4)
    assert 0.02 < error_in(text) < 0.04


def test_names_that_the_schema_would_refuse():
    with pytest.raises(ValueError, match="positive"):
        replace(NAMES, focal_length_mm=0.0)
    with pytest.raises(ValueError, match="names"):
        replace(NAMES, mount="")
    with pytest.raises(InputRejected, match="type the name again"):
        export(LENS, replace(NAMES, camera_model="A\x00B"))
    # an ideographic space, which Python does not count as printable
    maker = "光学\u3000株式会社"
    assert ET.fromstring(export(LENS, replace(NAMES, lens_make=maker))).findtext("lens/maker") == maker


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
