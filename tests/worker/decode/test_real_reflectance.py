"""Real captures of a Sequoia and a RedEdge, from the file to irradiance, radiance and reflectance."""

import math

import numpy as np
import pytest
from scipy import ndimage

from radiometry.fitting.evidence import Region
from radiometry.frame.exposure import Exposure
from radiometry.frame.roi import Polygon, Window
from radiometry.reflectance import method as reflectance
from radiometry.reflectance.alignment import align
from radiometry.reflectance.findings import check_frame
from radiometry.reflectance.imaging import FrameSize, evaluate_polynomial
from radiometry.reflectance.results import evaluate_k
from radiometry.reflectance.sun import read_clock_s
from radiometry.reflectance.sunshine import measure_sunshine
from tests.support import reader

# Rows 440 to 519, columns 600 to 679.
CENTRE = Polygon.from_points([(600, 440), (680, 440), (680, 520), (600, 520)])
# The file's suffix; irradiance of the centre; mean CH0 of the sunshine sensor; error of the wrong order.
SEQUOIA = {
    "green": ("GRE", 0.531310, 34.0, 0.0372),
    "red": ("RED", 0.231775, 28.0, 0.0467),
    "red_edge": ("REG", 0.259554, 5.2, 0.1944),
    "nir": ("NIR", 0.224353, 14.0, 0.0667),
}
# u(K) [%] by the reading, by attitude and haze, by all else; in all at the flight, and half an hour later.
U_OF_K = {
    "blue": (2.5, 2.8, 1.3, 4.0, 4.4),
    "green": (2.5, 2.9, 1.2, 4.1, 4.5),
    "red": (2.5, 2.9, 1.3, 4.1, 4.5),
    "red_edge": (2.5, 2.9, 1.2, 4.1, 4.5),
    "nir": (2.5, 2.9, 1.6, 4.2, 4.6),
}


def open_sequoia(folder, band):
    path = folder / "sequoia" / f"IMG_180413_080658_0000_{SEQUOIA[band][0]}.TIF"
    return path, reader.read_header(path)


def exposure_of(header):
    return Exposure(exposure_time_s=header.exposure_time_s, f_number=header.f_number, iso=header.iso)


def extract(path, header, polygon):
    frame = reader.read_window(path, 0, 0, header.height_px, header.width_px)
    region = Region(name="", polygon=polygon)
    return reflectance.extract(frame, [region], header=header, exposure=exposure_of(header)).features


@pytest.mark.parametrize("band", SEQUOIA)
def test_sequoia_irradiance_of_the_centre_sunshine_and_vignetting(real_files, band):
    """Ten readings at gain index 1 and 100 ms each.

    The public scripts' order of vignetting and black, p / V - B, errs by 4 to 19 % in the 40 x 40 pixels of
    the top left corner.
    """
    _, i_sq, counts, error = SEQUOIA[band]
    path, header = open_sequoia(real_files, band)
    features = extract(path, header, CENTRE)
    assert (features.i_sq, features.statistics.n) == (pytest.approx(i_sq, abs=1e-6), 6400)
    told = header.multispectral
    found = measure_sunshine(told)
    assert found.i_ss == pytest.approx(counts / 0.1)
    assert (found.readings, found.gain_indices, found.flags) == (10, (1,), ())
    assert measure_sunshine(told, choice="nearest").i_ss == measure_sunshine(told, choice="last").i_ss
    samples = reader.read_window(path, 0, 0, 40, 40).samples_dn
    size = FrameSize(height_px=header.height_px, width_px=header.width_px)
    window = Window(row0=0, col0=0, height=40, width=40)
    share = evaluate_polynomial(told.vignetting_polynomial, window, size=size)
    right = (samples - told.sensor_model.b) / share
    wrong = samples / share - told.sensor_model.b
    assert wrong.mean() / right.mean() - 1 == pytest.approx(error, abs=5e-4)


def test_the_green_band_s_two_blacks_disagree(real_files):
    """SensorModel says 3067.5, the black level 4973.25: 9 % of this panel's signal. The others agree."""
    raised = {band: check_frame(open_sequoia(real_files, band)[1]) for band in SEQUOIA}
    assert {band: [each.flag for each in flags] for band, flags in raised.items()} == {
        "green": ["black_level_disagrees"],
        "red": [],
        "red_edge": [],
        "nir": [],
    }


def test_a_real_capture_calibrates_and_gives_its_own_reflectance_back(real_files):
    """K by hand for green: 0.2 * 340 / 0.531310 = 127.986."""
    rows, readings = [], []
    for band in SEQUOIA:
        path, header = open_sequoia(real_files, band)
        features = extract(path, header, CENTRE)
        given = {"role": "panel", "scene": None, "statistics": None, "features": features}
        exposure = exposure_of(header)
        rows.append(reflectance.FrameRow(frame=path.name, header=header, exposure=exposure, **given))
        stated = {"reflectance": 0.2, "standard_uncertainty": 0.004}
        readings.append(reflectance.Reading(panel="P", band=band, **stated))
    fit = reflectance.fit(rows, readings, reflectance.Params(sunshine_surface="oriented"))
    ks = {each.coefficient.band: each.coefficient.reflectance_k for each in fit.band_fits}
    assert ks["green"] == pytest.approx(0.2 * 340.0 / 0.531310, rel=1e-5)
    assert ks["red_edge"] == pytest.approx(0.2 * 52.0 / 0.259554, rel=1e-5)
    coefficients = [each.coefficient for each in fit.band_fits]
    for row in rows:
        found = reflectance.apply_features(row.features, header=row.header, coefficients=coefficients)
        assert found.reflectance.value == pytest.approx(0.2, rel=1e-12)


def test_one_light_reading_of_a_rededge_bounds_u_of_k(real_files):
    """Panel good to 1 %, levelled by a bubble: the reading, and its attitude and the haze, are most of u."""
    rows, readings = [], []
    for band in range(1, 6):
        path = real_files / "rededge" / f"0000SET_000_IMG_0000_{band}.tif"
        header = reader.read_header(path)
        whole = reader.read_window(path, 0, 0, header.height_px, header.width_px)
        found = reflectance.find_region(whole, header=header)
        features = extract(path, header, found.region)
        given = {"role": "panel", "scene": None, "statistics": None, "features": features}
        rows.append(
            reflectance.FrameRow(frame=path.name, header=header, exposure=exposure_of(header), **given)
        )
        stated = {"reflectance": 0.67, "standard_uncertainty": 0.0067}
        readings.append(reflectance.Reading(panel="P", band=header.multispectral.band, **stated))
    flown_s = read_clock_s(reader.read_header(real_files / "rededge" / "0000SET_000_IMG_0001_1.tif"))
    fit = reflectance.fit(rows, readings, reflectance.Params(panel_level="measured"))
    table = {}
    for each in fit.band_fits:
        u = {entry.source: 100 * entry.u_rel for entry in each.budget}
        rest = math.hypot(u["panel reflectance"], u["panel angle"], u["panel evenness"], u["pixel noise"])
        flown = evaluate_k(each.coefficient, at_s=flown_s)
        table[each.coefficient.band] = (
            u["sunshine readings"],
            u["sunshine tilt"],
            rest,
            100 * math.hypot(flown.u_rel, flown.drift_u_rel),
            100 * each.coefficient.reflectance_k_standard_uncertainty / each.coefficient.reflectance_k,
        )
    assert {band: pytest.approx(figures, abs=0.05) for band, figures in table.items()} == U_OF_K


def test_saturated_pixels_of_a_real_flight_capture_are_counted(real_files):
    """The brightest number is 65520: with 65535 none of these 1829 would count."""
    path = real_files / "rededge" / "0000SET_000_IMG_0001_1.tif"
    header = reader.read_header(path)
    whole = Polygon.from_points([(0, 0), (1280, 0), (1280, 960), (0, 960)])
    share = extract(path, header, whole).statistics.saturated_share
    assert share == pytest.approx(1829 / (1280 * 960))


def _edges(plane):
    smooth = ndimage.gaussian_filter(np.nan_to_num(plane.astype(float), nan=3000.0), 1.5)
    return np.hypot(*np.gradient(np.log(np.maximum(smooth, 3000.0) - 2500.0)))


def _shift(one, other):
    """By how many pixels (down, right) the second shows what the first does: their edges' correlation."""
    weight = np.outer(np.hanning(one.shape[0]), np.hanning(one.shape[1]))
    spectra = [np.fft.fft2((part - part.mean()) * weight) for part in (one, other)]
    found = np.fft.ifft2(np.conj(spectra[0]) * spectra[1]).real
    row, col = np.unravel_index(found.argmax(), found.shape)
    half = one.shape[0] // 2
    return np.array([(row + half) % one.shape[0] - half, (col + half) % one.shape[1] - half])


def test_alignment_leaves_the_parallax_of_a_square_rig(real_files):
    """The sense of the rotations, found on a scene close by.

    The four lenses of a Sequoia sit on a square, so once the turning is undone the near scene must be moved
    straight down in red, straight left in red edge, and by the sum of both in near infrared. No other sense
    or order of the rotations gives that: the raw images are moved by (30, 24), (19, -46) and (62, -10).
    """
    part = np.s_[350:606, 920:1176]
    _, onto = open_sequoia(real_files, "green")
    frames = {}
    for band in SEQUOIA:
        path, header = open_sequoia(real_files, band)
        plane = reader.read_window(path, 0, 0, 960, 1280).samples_dn.astype(np.float32)
        frames[band] = align(plane, of=header.multispectral.geometry, onto=onto.multispectral.geometry)
    edges = {band: _edges(plane)[part] for band, plane in frames.items()}
    red, red_edge, nir = (_shift(edges["green"], edges[band]) for band in ("red", "red_edge", "nir"))
    assert abs(red[1]) <= 2
    assert abs(red_edge[0]) <= 2
    assert abs(abs(red[0]) - abs(red_edge[1])) <= 3
    assert np.abs(nir - red - red_edge).max() <= 2


@pytest.mark.parametrize(("number", "most_px"), [(1, 4), (3, 3), (4, 3)])
def test_stated_offsets_bring_the_bands_of_a_real_p4_multispectral_together(real_files, number, most_px):
    """Raw, blue lies 9 to 11 rows above near infrared; parallax and rotation remain."""
    part = np.s_[520:776, 670:926]
    frames = {}
    for each in (5, number):
        path = real_files / "p4m" / f"DJI_001{each}.TIF"
        samples = reader.read_window(path, 0, 0, 1300, 1600).samples_dn.astype(np.float32)
        frames[each] = samples, reader.read_header(path).multispectral.geometry
    (nir, onto), (other, of) = frames[5], frames[number]
    aligned = align(other, of=of, onto=onto)
    assert np.abs(_shift(_edges(nir)[part], _edges(aligned)[part])).max() <= most_px
    if number == 1:
        assert np.abs(_shift(_edges(nir)[part], _edges(other)[part])).max() >= 9
