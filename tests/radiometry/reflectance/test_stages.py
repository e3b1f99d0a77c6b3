"""From raw numbers to irradiance or radiance, a stage at a time, against figures worked out by hand."""

import contextlib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radiometry.findings import InputRejected
from radiometry.frame import multispectral
from radiometry.frame.exposure import Exposure, Settings
from radiometry.frame.roi import Polygon, Window
from radiometry.reflectance import imaging
from simulation.sequoia import LENS, capture
from tests.radiometry.frames import frame_of
from tests.radiometry.reflectance.captures import CAMERA, make_header, seeded

SETTINGS = Settings(exposure_time_s=0.003, f_number=2.2, iso=206.0)
MODEL = multispectral.SensorModel(a=310316.1, b=3067.5, c=4773.6)
# Published for rows y = 0, .25, .. 1 and columns x = 0, .25, .. 1.
GRID = [
    [0.71, 0.89, 0.94, 0.91, 0.75],
    [0.79, 0.94, 0.98, 0.95, 0.83],
    [0.81, 0.95, 0.98, 0.96, 0.85],
    [0.77, 0.92, 0.96, 0.93, 0.80],
    [0.66, 0.85, 0.90, 0.85, 0.69],
]


def whole(height, width):
    return Window(row0=0, col0=0, height=height, width=width)


def with_lens(lens):
    return replace(MICASENSE[0].multispectral, radial_vignetting=lens)


def cut(frame, window):
    """The same frame, of which only a window was read."""
    rows = slice(window.row0, window.row0 + window.height)
    cols = slice(window.col0, window.col0 + window.width)
    return replace(frame, samples_dn=frame.samples_dn[rows, cols], row0=window.row0, col0=window.col0)


def test_vignetting_grid_is_the_published_one():
    share = imaging.evaluate_polynomial(LENS, whole(5, 5), size=imaging.FrameSize(height_px=4, width_px=4))
    np.testing.assert_array_equal(share.round(2), GRID)


def test_each_stage_of_a_sequoia_by_hand():
    even = np.array([[42115.0, -33.75]])  # (24125 - 3067.5) / 0.5 and (3000 - 3067.5) / 2
    # 4.84 / (310316.1 * 0.003 * 206 + 4773.6) = 2.4624909e-05
    irradiance = imaging.scale_to_irradiance(even, model=MODEL, settings=SETTINGS)
    assert irradiance == pytest.approx(even * 2.4624909e-05, rel=1e-6)


def test_each_stage_of_a_micasense_camera_by_hand():
    model = multispectral.RadianceModel(a1=2e-4, a2=1e-6, a3=2e-3)
    settings = Settings(exposure_time_s=0.001, f_number=2.8, iso=200.0)
    found = imaging.scale_to_radiance(np.full((2, 2), 0.5), model=model, settings=settings, row0=100)
    # L = (2e-4 / 2) 0.5 / (0.001 + 1e-6 row - 2e-3 * 0.001 row)
    assert found == pytest.approx(np.array([[5e-5 / 0.0009] * 2, [5e-5 / 0.000899] * 2]), rel=1e-12)
    lens = multispectral.RadialVignetting(centre_x_px=3.0, centre_y_px=4.0, coefficients=(-0.01, 0.001))
    share = imaging.evaluate_band(
        with_lens(lens), whole(5, 1), size=imaging.FrameSize(height_px=5, width_px=1)
    )
    assert share[0, 0] == pytest.approx(1.0 - 0.01 * 5.0 + 0.001 * 25.0)  # r = 5


def test_a_miswritten_exposure_is_put_right():
    model = multispectral.RadianceModel(a1=1.0, a2=0.0, a3=0.0)
    settings = Settings(exposure_time_s=1 / 6329, f_number=2.8, iso=100.0)
    found = imaging.scale_to_radiance(np.ones((1, 1)), model=model, settings=settings, row0=0)
    assert found[0, 0] == pytest.approx(1 / 0.000274)


@pytest.mark.parametrize("c", [-1e9, -310316.1 * 0.003 * 206.0])
def test_a_sensor_without_response_is_refused(c):
    model = replace(MODEL, c=c)
    with pytest.raises(InputRejected, match="no positive response"):
        imaging.scale_to_irradiance(np.ones((1, 1)), model=model, settings=SETTINGS)


@pytest.mark.parametrize("constant", [0.0, 0.04, 2.1, -1.0])
def test_a_polynomial_that_is_no_lens_is_refused(constant):
    lens = multispectral.VignettingPolynomial(exponents=((0, 0),), coefficients=(constant,))
    with pytest.raises(InputRejected, match="not a lens"):
        imaging.evaluate_polynomial(lens, whole(2, 2), size=imaging.FrameSize(height_px=2, width_px=2))
    radial = multispectral.RadialVignetting(centre_x_px=-1.0, centre_y_px=0.0, coefficients=(constant - 1.0,))
    with pytest.raises(InputRejected, match="not a lens"):
        imaging.evaluate_band(with_lens(radial), whole(1, 1), size=imaging.FrameSize(height_px=1, width_px=1))


@given(st.integers(0, 100), st.integers(0, 130), st.integers(1, 20), st.integers(1, 30), st.booleans())
def test_a_window_gives_what_the_whole_frame_gives(row0, col0, height, width, radial):
    header, frame, exposure = MICASENSE if radial else SEQUOIA
    full = imaging.compute_signal(frame, header=header, settings=exposure.on_basis("nominal"))
    window = Window(row0=row0, col0=col0, height=height, width=width)
    part = imaging.compute_signal(cut(frame, window), header=header, settings=exposure.on_basis("nominal"))
    np.testing.assert_array_equal(part, full[row0 : row0 + height, col0 : col0 + width])


def make_sequoia():
    shot = capture(CAMERA, seeded(), reflectance={"red": 0.2})["red"]
    return shot.header, shot.frame, shot.exposure


def make_micasense():
    samples = (seeded(2).integers(300, 4095, (120, 160)) * 16).astype(np.uint16)
    band = multispectral.Multispectral(
        system="micasense",
        band="blue",
        band_name="Blue",
        full_scale_dn=65520.0,
        radiance_model=multispectral.RadianceModel(a1=1.5e-4, a2=1.2e-7, a3=1.4e-6),
        radial_vignetting=multispectral.RadialVignetting(
            centre_x_px=82.0, centre_y_px=55.0, coefficients=(-1e-4, 1e-6)
        ),
    )
    frame = frame_of(samples, cfa="grey", size=(120, 160), black=4800.0, white=65520.0)
    return make_header(band), frame, Exposure(exposure_time_s=0.001, f_number=2.8, iso=100.0)


SEQUOIA, MICASENSE = make_sequoia(), make_micasense()


def test_a_file_of_another_camera_is_refused():
    _, frame, exposure = SEQUOIA
    with pytest.raises(InputRejected, match="does not say which band") as refusal:
        imaging.compute_signal(frame, header=make_header(None), settings=exposure.on_basis("nominal"))
    assert refusal.value.code == "sensor_model_unusable"


@pytest.mark.parametrize(
    ("made", "lost"),
    [
        (SEQUOIA, "sensor_model"),
        (SEQUOIA, "vignetting_polynomial"),
        (MICASENSE, "radiance_model"),
        (MICASENSE, "radial_vignetting"),
    ],
)
def test_a_band_without_its_model_is_refused(made, lost):
    header, frame, exposure = made
    band = replace(header.multispectral, **{lost: None})
    with pytest.raises(InputRejected, match="no readable"):
        imaging.compute_signal(
            frame, header=replace(header, multispectral=band), settings=exposure.on_basis("nominal")
        )


def test_features_are_those_of_the_region():
    header, frame, exposure = SEQUOIA
    region = Polygon.from_points([(20, 30), (60, 30), (60, 50), (20, 50)])
    found = imaging.extract_features(frame, region, header=header, exposure=exposure)
    signal = imaging.compute_signal(frame, header=header, settings=exposure.on_basis("nominal"))[30:50, 20:60]
    assert found.i_sq == pytest.approx(signal.mean(), rel=1e-12)
    assert found.i_sq_std == pytest.approx(signal.std(ddof=1), rel=1e-12)
    # noise far above the steps of 64: rounding averages out
    assert found.i_sq_standard_uncertainty == pytest.approx(signal.std(ddof=1) / np.sqrt(800), rel=1e-6)
    assert (found.band, found.statistics.channel, found.statistics.n) == ("red", "red", 800)
    assert found.i_sq_unit == "1"
    assert imaging.extract_features(
        MICASENSE[1], region, header=MICASENSE[0], exposure=MICASENSE[2]
    ).i_sq_unit == ("W/(m2*sr*nm)")


def test_rounding_in_steps_does_not_average_out_without_noise():
    header, frame, exposure = SEQUOIA
    flat = replace(frame, samples_dn=np.full_like(frame.samples_dn, 64 * 300))
    lens = multispectral.VignettingPolynomial(exponents=((0, 0),), coefficients=(1.0,))
    band = replace(header.multispectral, vignetting_polynomial=lens)
    header = replace(header, multispectral=band)
    region = Polygon.from_points([(20, 30), (60, 30), (60, 50), (20, 50)])
    found = imaging.extract_features(flat, region, header=header, exposure=exposure)
    expected = 64 / np.sqrt(12) / (64 * 300 - band.sensor_model.b)
    assert found.i_sq_standard_uncertainty / found.i_sq == pytest.approx(expected, rel=1e-9)


@given(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2))
def test_gradient_is_the_range_of_the_plane(across, down):
    rows, cols = np.mgrid[:21, :31]
    plane = 1.0 + across * (cols - 15) / 30 + down * (rows - 10) / 20
    inside = np.ones(plane.shape, bool)
    assert imaging.measure_gradient(plane, inside) == pytest.approx(abs(across) + abs(down), abs=1e-12)
    assert imaging.measure_gradient(plane.T, inside.T) == pytest.approx(abs(across) + abs(down), abs=1e-12)


def test_a_line_has_no_gradient():
    inside = np.zeros((5, 5), bool)
    inside[2] = True
    assert imaging.measure_gradient(np.arange(25.0).reshape(5, 5), inside) == 0.0


REAL = st.floats(-1e15, 1e15)


@given(
    a=REAL,
    b=REAL,
    c=REAL,
    exponents=st.lists(st.tuples(st.integers(0, 8), st.integers(0, 8)), min_size=1, max_size=6),
    data=st.data(),
)
def test_whatever_a_file_states_is_a_finite_signal_or_a_refusal(a, b, c, exponents, data):
    header, frame, exposure = SEQUOIA
    coefficients = data.draw(st.lists(REAL, min_size=len(exponents), max_size=len(exponents)))
    band = replace(
        header.multispectral,
        sensor_model=multispectral.SensorModel(a=a, b=b, c=c),
        vignetting_polynomial=multispectral.VignettingPolynomial(
            exponents=tuple(exponents),
            coefficients=(data.draw(st.sampled_from([0.9, coefficients[0]])), *coefficients[1:]),
        ),
    )
    told = replace(header, multispectral=band)
    with contextlib.suppress(InputRejected):
        signal = imaging.compute_signal(frame, header=told, settings=exposure.on_basis("nominal"))
        assert np.isfinite(signal).all()
