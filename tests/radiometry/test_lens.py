"""Vignetting applied: by hand, over structured surfaces, in maps, and with what the errors of V do."""

import math
from dataclasses import replace

import numpy as np
import pytest

from radiometry.findings import InputRejected
from radiometry.fitting.evidence import Quantity
from radiometry.frame.exposure import Exposure
from radiometry.frame.grid import Grid
from radiometry.frame.roi import Polygon
from radiometry.luminance import maps
from radiometry.luminance.application import change_luminance
from radiometry.luminance.measurement import Request, Vignetting, measure
from radiometry.vignetting.lens import Lens
from tests.radiometry.coefficients import COEFFICIENT
from tests.radiometry.frames import frame_of
from tests.radiometry.luminance.exact import PARAMS, ROWS, K, fit
from tests.radiometry.vignetting.flats import coefficient

SHAPE = (64, 96)
RADIUS = math.hypot(*SHAPE) / 2
CENTRE = (20.0, 60.0)
K1 = {"R": -0.30, "G1": -0.40, "G2": -0.38, "B": -0.42, "G": -0.40, "grey": -0.40}
U_K1 = 0.01
WITH = replace(COEFFICIENT, vignetting="00")
EXPOSURE = Exposure(exposure_time_s=0.01, f_number=4.0, iso=3200.0)
PER_DN = 16 / (30 * 0.01 * 3200)
CORNER = Polygon.from_points([(4, 36), (24, 36), (24, 60), (4, 60)])


def falloff(channel, f_number=4.0, k1=None, **changes):
    covariance = np.zeros((5, 5))
    covariance[0, 0] = U_K1**2
    curve = {"radius_px": RADIUS, "k1": K1[channel] if k1 is None else k1, "k2": 0.0}
    place = dict(
        zip(("height_px", "width_px", "centre_row_px", "centre_col_px"), SHAPE + CENTRE, strict=True)
    )
    given = {"f_number": f_number, "channel": channel, "covariance": tuple(map(tuple, covariance.tolist()))}
    return coefficient(**given | place | curve | changes)


LENS = Lens(coefficients=tuple(falloff(name) for name in K1), f_number=4.0)


def squared(shape=SHAPE):
    rows, cols = np.indices(shape)
    return ((rows - CENTRE[0]) ** 2 + (cols - CENTRE[1]) ** 2) / RADIUS**2


def sites(cfa):
    """Channel by site of the pattern, named by hand."""
    return {"RGGB": ["R", "G1", "G2", "B"], "GBRG": ["G2", "B", "R", "G1"]}[cfa]


def shares_of(cfa):
    if cfa == "grey":
        return 1 + K1["grey"] * squared()
    ks = np.array([K1[name] for name in sites(cfa)]).reshape(2, 2)
    return 1 + np.tile(ks, (SHAPE[0] // 2, SHAPE[1] // 2)) * squared()


def make_frame(samples, cfa="RGGB", **changes):
    whole = frame_of(samples, cfa=cfa, size=SHAPE, black=(256.0,) * 4, white=(65535.0,) * 4)
    return replace(whole, **changes)


def lit(light_dn, cfa="RGGB"):
    return make_frame(256.0 + light_dn * shares_of(cfa), cfa)


def measured(frame, coefficient=WITH, lens=LENS, **asked):
    return measure(
        frame,
        Request(**({"polygon": CORNER} | asked)),
        exposure=EXPOSURE,
        coefficients=(coefficient,),
        calibrated=(),
        correction=Vignetting(name="cal_v", lens=lens) if lens else None,
    )


@pytest.mark.parametrize("cfa", ["RGGB", "GBRG", "grey"])
def test_an_even_surface_is_as_bright_in_the_corner(cfa):
    found = measured(lit(20_000.0, cfa))
    expected = 20_000.0 * PER_DN
    # rounded to whole DN: half of one, over V of more than a half; of a mean far less
    assert found.mean.value == pytest.approx(expected, rel=1e-5)
    for name in ("smallest", "median", "largest"):
        assert getattr(found, name).value == pytest.approx(expected, abs=1.1 * PER_DN)
    assert [p.luminance.value for p in found.percentiles] == pytest.approx([expected] * 4, abs=1.1 * PER_DN)
    assert found.vignetting == "cal_v"
    assert {raised.flag for raised in found.flags} == {"observer_differs", "outside_signals"}


def test_a_structured_surface_has_the_mean_of_its_pixels():
    """Bright where the lens passes little: the mean signal over the mean V would count it too little."""
    scene = 4_000.0 + 20_000.0 * squared()
    found = measured(make_frame(256.0 + scene * shares_of("RGGB")))
    inside = np.zeros(SHAPE, bool)
    inside[36:60, 4:24] = True
    means = [scene[row::2, col::2][inside[row::2, col::2]].mean() for row, col in ((0, 1), (1, 0))]
    assert found.mean.value == pytest.approx(np.mean(means) * PER_DN, rel=1e-5)
    through = shares_of("RGGB")
    naive = np.mean((scene * through)[inside]) / through[inside].mean()
    assert abs(naive / np.mean(means) - 1) > 0.01


def test_the_errors_of_v_reach_the_mean_and_the_extremes():
    found = measured(lit(20_000.0))
    (row,) = [share for share in found.budget if share.source == "vignetting"]
    inside = squared()[36:60, 4:24].mean()
    # two greens, each with its own k1; V averages both
    share = 1 + (K1["G1"] + K1["G2"]) / 2 * inside
    expected = U_K1 * inside / math.sqrt(2) / share
    assert row.standard_uncertainty_cd_m2 == pytest.approx(found.mean.value * expected, rel=2e-3)
    assert row.shared
    part = shares_of("RGGB")[36:60, 4:24]
    greens = (part[::2, 1::2], part[1::2, ::2])
    assert found.lens_share.value == pytest.approx(2 / sum(np.mean(1 / green) for green in greens), rel=1e-6)
    exact = replace(
        WITH,
        covariance=((0.0,),),
        meter_calibration_u_rel=0.0,
        f_number_u_rel=0.0,
        exposure_time_u_rel=0.0,
        dark_signal_standard_uncertainty_dn=0.0,
    )
    for pixel in (measured(lit(20_000.0), exact).smallest, measured(lit(20_000.0), exact).largest):
        # one pixel, of one green, somewhere in the region: between its nearest and its farthest place
        rel = pixel.standard_uncertainty / pixel.value
        places = squared()[36:60, 4:24]
        ends = [
            0.99 * U_K1 * places.min() / (1 + K1["G2"] * places.min()),
            1.01 * U_K1 * places.max() / (1 + K1["G1"] * places.max()),
        ]
        assert ends[0] < rel < ends[1]


def test_noise_and_dark_grow_with_the_gain():
    samples = 256.0 + 2_000.0 * shares_of("RGGB") + np.random.default_rng(1).normal(0.0, 20.0, SHAPE)
    plain, corrected = measured(make_frame(samples), COEFFICIENT, None), measured(make_frame(samples))
    dark, noise = (
        [
            next(s.standard_uncertainty_cd_m2 for s in found.budget if s.source == source)
            for found in (plain, corrected)
        ]
        for source in ("dark signal", "pixel noise")
    )
    assert dark[1] == pytest.approx(dark[0] / corrected.lens_share.value, rel=1e-9)
    # 240 pixels' noise each over its own V; the falloff's slope, 50 DN here, is none of it
    part = shares_of("RGGB")[36:60, 4:24]
    expected = 20.0 * math.sqrt(np.mean(part**-2.0) / 240) * PER_DN
    assert noise[1] == pytest.approx(expected, rel=4 / math.sqrt(2 * 240))
    assert noise[0] > 3 * noise[1]


@pytest.mark.parametrize(("channel", "cfa"), [("green", "RGGB"), ("grey", "RGGB"), ("green", "GBRG")])
def test_a_map_is_divided_pixel_by_pixel_and_by_strips(channel, cfa):
    coefficient = replace(WITH, channel=channel)
    scale = maps.find_map_scale((coefficient,), EXPOSURE, lens=LENS)
    frame = lit(20_000.0, cfa)
    whole = maps.compute_map(frame, scale)
    if channel == "green":
        # at the rim a neighbour inside stands for the one outside, where the lens passes another share
        assert whole[1:-1, 1:-1] == pytest.approx(np.full((62, 94), 20_000.0 * PER_DN), rel=1e-3)
    else:
        # colours that pass unequal shares: K of grey holds for their mean
        assert whole[2:-2, 2:-2] == pytest.approx(np.full((60, 92), 20_000.0 * PER_DN), rel=2e-3)
    top, bottom = 16, 40
    strip = replace(
        frame, samples_dn=frame.samples_dn[top - maps.RIM_PX : bottom + maps.RIM_PX], row0=top - maps.RIM_PX
    )
    assert np.array_equal(maps.compute_map(strip, scale)[maps.RIM_PX : -maps.RIM_PX], whole[top:bottom])


def test_the_signal_s_channels_by_pattern():
    assert maps.name_channels("GBRG", channel="green") == ("G2", "G1")
    assert maps.name_channels("RGGB", channel="grey") == ("R", "G1", "G2", "B")
    assert maps.name_channels("rgb", channel="green") == ("G",)
    assert maps.name_channels("grey", channel="green") == ("grey",)


def test_cells_share_the_errors_of_v_place_by_place():
    """k1 alone is uncertain: a ratio of two places changes by the difference of what it does to each."""
    grid = Grid(corners=((0.0, 0.0), (96.0, 0.0), (96.0, 64.0), (0.0, 64.0)), rows=1, columns=2)
    lens = Lens(coefficients=(falloff("grey"),), f_number=4.0)
    exact = replace(WITH, dark_signal_standard_uncertainty_dn=0.0)
    found = measured(lit(20_000.0, "grey"), exact, lens, grid=grid)
    relative = [
        U_K1 * squared()[:, part].mean() / (1 + K1["grey"] * squared()[:, part]).mean()
        for part in (slice(0, 48), slice(48, 96))
    ]
    ratio = found.surface.u_l[0]
    # an even surface still has the spread of its rounding; the lens's part dominates
    assert ratio.standard_uncertainty == pytest.approx(abs(relative[0] - relative[1]), rel=0.05)


def test_a_k_and_a_correction_belong_together():
    with pytest.raises(InputRejected, match="measure with the vignetting version") as refused:
        measured(lit(2_000.0), WITH, None)
    assert refused.value.code == "vignetting_not_calibrated"
    with pytest.raises(InputRejected, match="uncorrected signals alone"):
        measured(lit(2_000.0), COEFFICIENT, LENS)
    with pytest.raises(InputRejected, match="vignetting"):
        maps.find_map_scale((WITH,), EXPOSURE)


# --- the fit

SHARES = {5.6: (0.8, 0.004), 8.0: (0.9, 0.002), 16.0: (0.97, 0.001)}
CORRECTED = replace(PARAMS, vignetting="00")


def through(row, shares=SHARES):
    """The frame as a lens that passes less would give it, and V as its calibration found it."""
    if row.role == "dark":
        return row
    value, u = shares[row.exposure.f_number]
    (one,) = row.statistics
    dimmed = replace(one, mean_dn=256.0 + (one.mean_dn - 256.0) * value)
    share = Quantity(value=value, standard_uncertainty=u, unit="1")
    return replace(row, statistics=(dimmed,), lens_share=share)


def test_k_is_that_of_the_centre():
    rows = tuple(map(through, ROWS))
    found = fit(rows, params=CORRECTED)
    coefficient = found.iso_fits[0].coefficient
    assert coefficient.luminance_k == pytest.approx(K, rel=1e-9)
    assert coefficient.vignetting == "00"
    assert fit(rows).iso_fits[0].coefficient.vignetting is None
    point = next(p for p in found.points if p.f_number == 5.6)
    assert point.adjusted_signal_dn == pytest.approx((point.signal_dn - 256.0) / 0.8)
    # what the sensor gave, whatever the lens passed
    signals = [p.signal_dn - 256.0 for p in found.points]
    assert coefficient.signal_range_dn == pytest.approx((min(signals), max(signals)))
    assert found.passed


def test_the_error_of_v_is_shared_within_an_f_number():
    """Of three f-numbers with equal weights K has a third of each error: the root of their squares over 3."""
    rows = tuple(
        replace(r, statistics=(replace(r.statistics[0], std_dn=1.0, n=10**8),)) for r in map(through, ROWS)
    )
    budget = {entry.source: entry for entry in fit(rows, params=CORRECTED).iso_fits[0].budget}
    plain = {entry.source for entry in fit().iso_fits[0].budget}
    assert set(budget) - plain == {"vignetting"}
    expected = math.hypot(*(u / value for value, u in SHARES.values())) / 3
    assert budget["vignetting"].u_rel == pytest.approx(expected, rel=0.03)
    assert sum(entry.variance_share for entry in budget.values()) == pytest.approx(1.0)


def test_a_fit_that_lacks_a_share_is_refused():
    rows = tuple(map(through, ROWS))
    rows = (replace(rows[0], lens_share=None), *rows[1:])
    with pytest.raises(InputRejected, match=f"No V of the region: frame {rows[0].frame}") as refused:
        fit(rows, params=CORRECTED)
    assert refused.value.code == "vignetting_not_calibrated"


def test_versions_with_different_vignetting_are_not_compared():
    def change(old, new, **more):
        return change_luminance([old], [new], exposure=EXPOSURE, signal_dn=756.0, **more)

    assert "different vignetting" in change(COEFFICIENT, WITH).why
    darker = replace(WITH, dark_signal_dn=266.0, parameters=(30.0, 0.0), model="affine")
    found = change(replace(WITH, parameters=(30.0, 10.0), model="affine"), darker, lens_share=0.5)
    # 490 DN over a half, against 500 over a half less 10
    assert found.change.value == pytest.approx(100 * (980 / 990 - 1))
