"""Repeated frames as one: noise averages, shared errors do not, and what else differs is in the budget."""

import math
from dataclasses import replace

import numpy as np
import pytest

from radiometry.findings.grouping import advise
from radiometry.fitting.curve import coverage_factor
from radiometry.fitting.evidence import FieldCorrection
from radiometry.fitting.sources import FLICKER
from radiometry.frame.grid import Grid
from radiometry.frame.statistics import Signal
from radiometry.luminance.pixels import SCATTER, average_signals
from radiometry.luminance.surface import CalibratedCamera
from tests.radiometry.luminance.test_measurement import (
    COEFFICIENT,
    CORNERS,
    EXPOSURE,
    PER_DN,
    flags,
    make_frame,
    measured,
    noisy,
)

GRID = Grid(corners=CORNERS, rows=2, columns=2)


def frames(lights, *, noise_dn=8.0):
    return [make_frame(noisy(light, seed=seed, noise_dn=noise_dn)) for seed, light in enumerate(lights)]


def budget(found):
    return {share.source: share.standard_uncertainty_cd_m2 for share in found.budget}


def test_noise_averages_and_shared_errors_do_not():
    first, *repeats = frames([1000.0] * 16)
    alone, together = measured(first), measured(first, repeats=repeats)
    for found, noise_dn in ((alone, 8.0), (together, 2.0)):
        assert found.noise_u_cd_m2 == pytest.approx(noise_dn / math.sqrt(80 * 48 / 2) * PER_DN, rel=0.05)
        # a single pixel of the average has a quarter of the noise, and so little that its extremes are nearer
        shared = found.shared_u_cd_m2 * found.smallest.value / found.mean.value
        assert found.smallest.standard_uncertainty == pytest.approx(
            math.hypot(shared, noise_dn * PER_DN), rel=0.1
        )
    assert together.mean.value == pytest.approx(1000.0 * PER_DN, rel=5e-4)
    assert together.largest.value - together.smallest.value < 0.4 * (
        alone.largest.value - alone.smallest.value
    )
    shared = {name: u for name, u in budget(together).items() if name not in {"pixel noise", SCATTER}}
    assert shared == pytest.approx({name: budget(alone)[name] for name in shared}, rel=1e-3)
    assert SCATTER not in budget(alone)
    assert "frames_disagree" not in flags(together)


def test_a_scatter_that_few_frames_showed_widens_what_a_later_frame_states():
    """5 % with six degrees of freedom is two thirds of the variance: k is Student's for 13."""
    few = replace(COEFFICIENT, frame_scatter_rel=0.05, frame_scatter_dof=6.0)
    found = measured(make_frame(noisy(1000.0)), coefficient=few)
    u_rel = found.mean.standard_uncertainty / found.mean.value
    assert found.effective_dof == pytest.approx(6.0 * (u_rel / 0.05) ** 4, rel=0.05)
    assert found.coverage_factor == coverage_factor(found.effective_dof) > 2.1


def test_changing_light_is_in_the_budget_and_cancels_between_cells():
    """A lamp that rises by 8 % a frame: the mean has the uncertainty of it, the uniformity has not."""
    steady, rising = (
        measured(first, repeats=repeats, grid=GRID)
        for first, *repeats in (frames([1000.0] * 4), frames([880.0, 960.0, 1040.0, 1120.0]))
    )
    assert flags(rising) - flags(steady) == {"frames_disagree"}
    assert "what the frames scatter is the largest source" in advise_on(rising)[-1]
    # four values by hand, and 1 % expected with four degrees of freedom
    squares = np.sum((np.array([880, 960, 1040, 1120]) - 1000) ** 2)
    expected = math.sqrt((4 * 10.0**2 + squares) / 7) / 2 * PER_DN
    assert budget(rising)[SCATTER] == pytest.approx(expected, rel=0.03)
    assert rising.effective_dof == pytest.approx(
        7 * (rising.mean.standard_uncertainty / expected) ** 4, rel=0.15
    )
    assert rising.expanded_uncertainty_cd_m2 == pytest.approx(
        rising.coverage_factor * rising.mean.standard_uncertainty
    )
    for found in (rising.surface.l_av_cd_m2, rising.surface.cells[0][0], rising.median, rising.smallest):
        assert found.standard_uncertainty > expected * 0.9
    assert rising.surface.u_o.standard_uncertainty < 2 * steady.surface.u_o.standard_uncertainty


def test_two_frames_under_flicker_by_hand():
    """Flicker of 3 % has 8 degrees of freedom, the frames' own 1 % has 4; they differ by 6 %."""
    flicker = FieldCorrection(source=FLICKER, u_rel=0.03 / math.sqrt(2), basis="")
    camera = CalibratedCamera(
        exposure=EXPOSURE, coefficient=COEFFICIENT, lens=None, corrections=(flicker,)
    ).average([signal_of(970.0), signal_of(1030.0)])
    before = 0.03**2 + 0.01**2
    dof = before**2 / (0.03**4 / 8 + 0.01**4 / 4)
    after = (dof * before + 2 * 0.03**2) / (dof + 1)
    assert camera.frames.dof == pytest.approx(dof + 1) == pytest.approx(10.64, abs=0.005)
    share = math.sqrt(after / before / 2)
    assert camera.corrections[0].u_rel == pytest.approx(share * 0.03)
    assert camera.frames.rel == pytest.approx(share * 0.01)


def signal_of(light_dn):
    return Signal(
        value_dn=256.0 + light_dn,
        standard_uncertainty_dn=0.0,
        saturated_share=0.0,
        black_level_dn=256.0,
        white_level_dn=4095.0,
    )


def test_the_average_of_three_frames_by_hand():
    """Noise of 6 DN a frame is 6 / sqrt(3) of the mean, and the rounding of 0.5 DN is the same in all."""
    error = {"standard_uncertainty_dn": math.hypot(6.0, 0.5), "rounding_dn": 0.5}
    mean = average_signals(
        [
            replace(signal_of(light_dn), saturated_share=share, **error)
            for light_dn, share in ((900.0, 0.0), (1000.0, 0.2), (1400.0, 0.1))
        ]
    )
    assert (mean.value_dn, mean.saturated_share) == (pytest.approx(256.0 + 1100.0), 0.2)
    assert mean.standard_uncertainty_dn == pytest.approx(math.sqrt(36.0 / 3.0 + 0.25))


def advise_on(found):
    return advise([], budget=[(share.source, share.variance_share) for share in found.budget])


def test_a_cell_that_changes_has_the_uncertainty_alone():
    """Something passes through one cell of three frames: the others keep theirs."""
    samples = [noisy(1000.0, seed=seed) for seed in range(3)]
    samples[1][10:34, 10:50] *= 0.9
    found = measured(make_frame(samples[0]), grid=GRID, repeats=[make_frame(each) for each in samples[1:]])
    relative = np.array(
        [[cell.standard_uncertainty / cell.value for cell in line] for line in found.surface.cells]
    )
    others = max(relative[0, 1], relative[1, 0], relative[1, 1])
    # black included it loses 12.5 %, of which three quarters are not the drift of all: once in three
    own = 0.094 * math.sqrt(2 / 3 / 6 / 3)
    assert math.sqrt(relative[0, 0] ** 2 - others**2) == pytest.approx(own, rel=0.1)
