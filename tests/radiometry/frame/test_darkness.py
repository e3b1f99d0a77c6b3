"""A dark frame that saw light is named beside every coefficient that rests on it."""

import dataclasses

import pytest

from radiometry.frame.verdicts import inspect_black
from radiometry.noise import fit as noise
from radiometry.vignetting import fit as vignetting
from simulation.camera import change
from tests.radiometry.noise.series import PARAMS, SMALL, brightened, take
from tests.radiometry.vignetting import flats


def raised(fit, flag):
    return [each for each in fit.flags if each.flag == flag]


@pytest.mark.parametrize(
    ("above_dn", "outcome"), [(20.0, None), (21.0, "warn"), (200.0, "warn"), (201.0, "fail")]
)
def test_the_limits_lie_where_they_are_said_to_lie(above_dn, outcome):
    """Of a span of 4000 DN half a per cent is 20, five are 200."""
    found = inspect_black(256.0 + above_dn, black_level_dn=256.0, white_level_dn=4256.0)
    assert (found.outcome if found else None) == outcome


def test_a_file_that_states_no_black_level_is_not_judged_by_it():
    assert inspect_black(900.0, black_level_dn=0.0, white_level_dn=4000.0) is None


@pytest.mark.parametrize(("by_dn", "names"), [(10, 0), (20, 1)])
def test_one_lit_dark_frame_of_a_noise_pair(by_dn, names):
    """A tenth of a per cent of 16127 DN is 16."""
    rows = take(SMALL, 3)
    (first, *_) = sorted(row.frame for row in rows if row.role == "dark")
    fit = noise.fit(brightened(rows, by_dn, lambda row: row.frame == first), PARAMS)
    found = raised(fit, "dark_not_dark")
    assert len(found) == names
    assert all(each.detail.startswith(f"{first}: Its mean is") for each in found)


def test_a_lamp_that_burnt_in_all_dark_frames_of_a_noise_campaign():
    fit = noise.fit(brightened(take(SMALL, 3), 900, lambda row: row.role == "dark"), PARAMS)
    (found,) = raised(fit, "dark_not_dark")
    assert "5.6% of the span" in found.detail
    assert "dark_not_dark" in noise.list_coefficients(fit)[0].flags


def test_a_warm_sensor_is_a_noise_campaign_s_subject():
    sensor = change(SMALL, dark_current_e_s=400.0)
    assert not raised(noise.fit(take(sensor, 5, dark_times=(0.02, 2.0)), PARAMS), "dark_not_dark")


@pytest.mark.parametrize(("black_level_dn", "flagged"), [(256.0, False), (290.0, True), (956.0, True)])
def test_lit_dark_frames_of_a_falloff(black_level_dn, flagged):
    """At 956 DN the falloff would come out twice as large, with a small uncertainty."""
    lens = change(flats.SMALL, falloffs={4.0: flats.SMALL.lens.falloffs[4.0]})
    bright = change(lens, black_level_dn=black_level_dn)
    stated = flats.dark(lens, 1)
    darks = [flats.dark(bright, seed, name=f"dark-{seed}") for seed in (2, 3)]
    levels = [channel.black_level_dn for channel in stated.features.channels]
    darks = [
        dataclasses.replace(
            each,
            features=dataclasses.replace(
                each.features,
                channels=tuple(
                    dataclasses.replace(channel, black_level_dn=level)
                    for channel, level in zip(each.features.channels, levels, strict=True)
                ),
            ),
        )
        for each in darks
    ]
    fit = vignetting.fit([flats.flat(lens, 1, 4.0), *darks], flats.NONE)
    found = raised(fit, "dark_not_dark")
    assert [each.where for each in found] == (["iso 100"] if flagged else [])
    assert all(each.detail.startswith("dark-2, dark-3: Its mean is") for each in found)
    assert ("dark_not_dark" in vignetting.list_coefficients(fit)[0].flags) is flagged
