"""Frames to photograph next, and the exposure times that a camera can take."""

import pytest

from radiometry.luminance.suggestions import find_gaps
from tests.radiometry.luminance.exact import DARKS, LIGHTS, PARAMS, READINGS, dark, light


def suggest(*more, darks=DARKS, mean_dn=None, luminance=None):
    """A scene "dim" that lacks two apertures, whose frame at f/5.6 has a signal of its own."""
    own = light("dim", 5.6, mean_dn=mean_dn, k=30.0 if luminance is None else 60.0 * luminance)
    gaps = find_gaps((*LIGHTS[:6], own, *darks, *more), READINGS, PARAMS)
    return {(gap.role, gap.at.get("f_number")): gap.exposure_time_s for gap in gaps if not gap.text}


def test_missing_apertures_have_the_time_of_half_the_span():
    """Half of 3839 DN at f/8 and 0.5 cd/m2: 2.56 s, longer than what the other frames show."""
    assert suggest() == {("light", 8.0): None, ("light", 16.0): None}
    found = suggest(dark("long", time_s=4.0))
    assert found == {("light", 8.0): pytest.approx(2.52, abs=0.01), ("light", 16.0): None}


def test_without_dark_frames_one_of_a_time_that_was_taken_is_suggested():
    assert suggest(darks=())["dark", 5.6] == 0.1


@pytest.mark.parametrize(("luminance", "known"), [(0.0, False), (1e-4, False), (5.0, True), (5e4, False)])
def test_no_time_is_suggested_that_a_camera_may_not_have(luminance, known):
    assert (suggest(luminance=luminance)["light", 8.0] is not None) is known
