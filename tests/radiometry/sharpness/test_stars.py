"""Siemens stars: contrast by frequency, directions, the centre, and what is refused."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from radiometry.findings import InputRejected
from radiometry.sharpness import codes, results
from radiometry.sharpness.positions import convert_resolution, find_resolving_power, unresolved_diameter
from radiometry.sharpness.profile import find_crossing
from radiometry.sharpness.results import Contrasts, Target
from simulation.camera import change
from simulation.targets import CHART_STUDIO, Star, true_mtf
from tests.radiometry.sharpness.shots import extract, render_chart, seeded

CAMERA = change(CHART_STUDIO, height_px=190, width_px=210)
STAR = Star(
    name="centre", row0=3, col0=15, size=184, centre_row_px=95.3, centre_col_px=107.7, cycles=36, blur_px=0.8
)
TARGET = Target(kind="siemens_star", cycles=36)


def photograph(star=STAR, camera=CAMERA):
    return render_chart(camera, [star], seeded())


def measure(star=STAR, *, camera=CAMERA, target=TARGET):
    (region,) = extract(photograph(star, camera), [star.region], camera=camera, target=target).regions
    return {each.channel: each for each in region.stars}


def power(curve, response, contrast=0.1):
    return find_resolving_power(response.frequency, curve, contrast=contrast)


def expect(response, blur_px):
    """The blur's transfer, relative to the rings that the star is compared with."""
    truth = true_mtf(np.array(response.frequency), blur="gaussian", blur_px=blur_px)
    return truth / truth[:6].mean()


@pytest.fixture(scope="module")
def star():
    return measure()["grey"]


def test_the_contrast_is_the_blur_s_transfer_at_n_over_2_pi_r(star):
    assert np.abs(np.array(star.whole.contrast) - expect(star, 0.8)).max() < 0.015
    assert star.frequency[0] == pytest.approx(36 / (2 * np.pi * star.outer_radius_px))
    assert star.frequency[-1] == pytest.approx(0.5)
    assert np.all(np.diff(star.frequency) > 0)


def test_the_resolving_power_follows(star):
    """exp(-2 (pi s f)^2) falls to a tenth of the reference's; s holds the two samples that make a pixel."""
    blur_px = np.hypot(0.8, 0.125)
    truth = true_mtf(np.array(star.frequency), blur="gaussian", blur_px=blur_px)[:6].mean()
    expected = np.sqrt(-np.log(0.1 * truth) / 2) / (np.pi * blur_px)
    for curve, most in (star.whole, 2.0), *((sector, 3.0) for sector in star.sectors):
        found = power(curve, star)
        assert abs(found.value - expected) < most * found.standard_uncertainty < 0.04 * expected
    assert [sector.direction_deg for sector in star.sectors] == [45.0 * k for k in range(8)]


def test_the_centre_is_found(star):
    assert star.centre_row_px == pytest.approx(95.3, abs=0.05)
    assert star.centre_col_px == pytest.approx(107.7, abs=0.05)


def test_a_known_centre_is_taken_in_the_coordinates_of_regions():
    target = replace(TARGET, centres=(results.StarCentre(region="centre", x_px=108.2, y_px=95.8),))
    found = measure(target=target)["grey"]
    assert (found.centre_row_px, found.centre_col_px) == (pytest.approx(95.3), pytest.approx(107.7))
    elsewhere = replace(TARGET, centres=(results.StarCentre(region="corner", x_px=50.0, y_px=50.0),))
    assert measure(target=elsewhere)["grey"].centre_row_px == pytest.approx(95.3, abs=0.05)


@pytest.mark.parametrize("changes", [{"cycles": 37}, {"cycles": 24, "bars": True}])
def test_bars_and_odd_cycles_do_as_well(changes):
    one = replace(STAR, **changes)
    found = measure(one, target=replace(TARGET, cycles=one.cycles))["grey"]
    assert np.abs(np.array(found.whole.contrast) - expect(found, 0.8)).max() < 0.03
    assert found.centre_row_px == pytest.approx(95.3, abs=0.1)


def test_uneven_light_does_not_hide_the_centre():
    """Three times as bright on the right as on the left."""
    frame = photograph()
    light = np.linspace(0.5, 1.5, CAMERA.camera.sensor.width_px)
    signal = (frame.samples_dn - 256.0) * light + 256.0
    (region,) = extract(
        replace(frame, samples_dn=np.round(signal).astype(np.uint16)), [STAR.region], target=TARGET
    ).regions
    found = region.stars[0]
    assert (found.centre_row_px, found.centre_col_px) == (
        pytest.approx(95.3, abs=0.1),
        pytest.approx(107.7, abs=0.1),
    )
    assert np.abs(np.array(found.whole.contrast) - expect(found, 0.8)).max() < 0.03


def smear(frame, axis):
    samples = gaussian_filter1d(frame.samples_dn.astype(np.float64), 0.8, axis=axis)
    return replace(frame, samples_dn=np.round(samples).astype(np.uint16))


@pytest.mark.parametrize(("axis", "weak", "strong"), [(0, (0, 4), (2, 6)), (1, (2, 6), (0, 4))])
def test_a_smear_shows_in_the_sectors_whose_spokes_lie_across_it(axis, weak, strong):
    """Smeared from top to bottom, spokes to the right (0) and left (180 degrees) go first."""
    (region,) = extract(smear(photograph(), axis), [STAR.region], target=TARGET).regions
    found = [power(sector, region.stars[0], 0.2).value for sector in region.stars[0].sectors]
    assert max(found[k] for k in weak) < 0.8 * min(found[k] for k in strong)


def test_a_mosaic_ends_at_each_channel_s_own_nyquist_frequency():
    found = measure(camera=change(CAMERA, cfa="RGGB"))
    ends = {name: each.frequency[-1] for name, each in found.items()}
    assert ends == {"R": pytest.approx(0.25), "G": pytest.approx(0.35355, abs=1e-4), "B": pytest.approx(0.25)}
    for each in found.values():
        assert np.abs(np.array(each.whole.contrast) - expect(each, 0.8)).max() < 0.03


def test_noise_is_taken_off_the_contrast_and_told_by_the_uncertainty():
    """With u^2 = 8 u_whole^2 in b and in c, noise alone would show as 16 u_whole^2."""
    camera = change(CAMERA, read_noise_e=800.0)
    one = replace(STAR, blur_px=1.5)
    unresolved, errors = [], []
    for seed in range(3):
        frame = render_chart(camera, [one], seeded(seed))
        found = extract(frame, [one.region], target=TARGET).regions[0].stars[0]
        contrast, u = np.array(found.whole.contrast), np.array(found.whole.contrast_u)
        unresolved.append(np.mean(contrast[-8:] ** 2) / np.mean(u[-8:] ** 2))
        errors.append(((contrast - expect(found, 1.5)) / u)[6:26])
    assert np.mean(unresolved) < 8.0
    assert 0.6 < np.sqrt(np.mean(np.square(errors))) < 1.5


@pytest.mark.parametrize(
    ("code", "camera", "target"),
    [
        (codes.CHART_CLIPPED, {"bright_dn": 20000.0}, {}),
        (codes.CHART_CONTRAST_TOO_LOW, {"dark_dn": 8000.0}, {}),
        (codes.STAR_NOT_FOUND, {}, {"cycles": 30}),
        (codes.STAR_TOO_SMALL, {}, {"cycles": 120}),
    ],
)
def test_a_star_that_cannot_be_measured_is_refused_by_name(code, camera, target):
    with pytest.raises(InputRejected) as refused:
        measure(camera=change(CAMERA, **camera), target=replace(TARGET, **target))
    assert refused.value.code is code
    assert refused.value.message.startswith("Region centre: ")


# --- Units, with the source's own numbers


def test_the_printed_lp_mm_are_line_widths_of_another_picture():
    """Equation 3: c/p * 1024 * 2 / 24 = 26.1, so 0.3059 cycles per pixel, and 13.05 line pairs."""
    cycles = 26.1 * 24.0 / (2 * 1024)
    assert cycles == pytest.approx(0.3059, abs=5e-5)
    found = convert_resolution(cycles, picture_height_px=1024, pixel_pitch_um=4.65)
    assert found.lp_per_mm_small_format == pytest.approx(13.05)
    assert found.lw_per_ph / 24.0 == pytest.approx(26.1)
    assert found.lp_per_ph == pytest.approx(313.2)
    assert found.lp_per_mm == pytest.approx(65.777, abs=1e-3)
    without = convert_resolution(0.25, picture_height_px=1000)
    assert (without.lp_per_mm, without.lw_per_ph) == (None, 500.0)
    assert unresolved_diameter(0.5, cycles=48) == pytest.approx(30.56, abs=5e-3)


def curve(*contrast, u=0.01):
    return Contrasts(direction_deg=None, contrast=contrast, contrast_u=(u,) * len(contrast))


# transfer of a blur, and where it falls to a tenth: Gaussian, a circular aperture's, an exponential, a box's
BLURS = {
    "gaussian": (lambda f: np.exp(-2.0 * np.pi**2 * 1.000761**2 * f**2) / 0.989, 0.3421),
    "aperture": (
        lambda f: 2.0 / np.pi * (np.arccos(f / 0.51) - f / 0.51 * np.sqrt(1.0 - (f / 0.51) ** 2)),
        0.80536 * 0.51,
    ),
    "exponential": (lambda f: np.exp(-6.0 * f), math.log(10.0) / 6.0),
    "box": (lambda f: np.sinc(f / 0.51), 0.90796 * 0.51),
}


@pytest.mark.parametrize("shape", BLURS)
@pytest.mark.parametrize(("ratio", "rings"), [(1.4, 6), (1.2, 10), (1.04, 48)])
def test_the_resolving_power_of_a_curved_response_is_within_its_uncertainty(shape, ratio, rings):
    """Rings that lie far apart cost uncertainty; those of a Gaussian blur do not even cost that."""
    response, truth = BLURS[shape]
    frequency = 0.5 / ratio ** np.arange(rings)[::-1]
    found = find_resolving_power(tuple(frequency), curve(*response(frequency), u=1e-4), contrast=0.1)
    assert abs(found.value - truth) < 2.0 * found.standard_uncertainty
    if shape == "gaussian":
        assert found.value == pytest.approx(0.3421, abs=1e-4)


def test_noise_of_the_rings_is_in_the_uncertainty():
    """48 rings, noise of 1 % and 2 %: 2 u holds the truth in nine cases of ten or more."""
    response, truth = BLURS["gaussian"]
    frequency = np.geomspace(0.08, 0.5, 48)
    for u in (0.01, 0.02):
        noisy = response(frequency) + np.random.default_rng(3).normal(0.0, u, (300, 48))
        found = [
            find_resolving_power(tuple(frequency), curve(*np.maximum(each, 0.0), u=u), contrast=0.1)
            for each in noisy
        ]
        assert np.mean([abs(each.value - truth) < 2.0 * each.standard_uncertainty for each in found]) > 0.9


@pytest.mark.parametrize("contrast", [(1.0, 0.9, 0.8), (0.05, 0.04, 0.03)])
def test_a_curve_that_does_not_cross_has_no_resolving_power(contrast):
    assert find_resolving_power((0.1, 0.2, 0.3), curve(*contrast), contrast=0.1) is None


def test_the_first_crossing_counts():
    assert find_crossing([0.0, 0.1, 0.2, 0.3, 0.4], [1.0, 0.6, 0.4, 0.7, 0.1], 0.5) == pytest.approx(0.15)
    assert math.isnan(find_crossing([0.0, 0.1], [1.0, 0.6], 0.5))
