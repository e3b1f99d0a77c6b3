"""What a campaign lacks for a good fit, said by name."""

from dataclasses import replace

import pytest

from radiometry.fitting.evidence import Exclusion
from radiometry.luminance import codes
from radiometry.luminance import method as luminance
from radiometry.luminance.points import collect_series
from radiometry.luminance.rows import Params
from radiometry.luminance.suggestions import plan
from tests.radiometry import evidence
from tests.radiometry.evidence import dark, light

LEVELS = {"a": 50.0, "b": 20.0, "c": 5.0, "d": 2.0, "e": 0.5}


def reading(scene, value=None, *, quantity="luminance", factor=1.0, **changes):
    value = factor * (LEVELS[scene] if value is None else value)
    return replace(evidence.reading(scene, value, quantity=quantity), **changes)


def lights(*scenes, f_numbers=(5.6, 8.0), levels=None):
    return tuple(light(s, f, luminance=(levels or LEVELS)[s]) for s in scenes for f in f_numbers)


def readings_of(*scenes):
    """Twice each, of luminance and of illuminance."""
    return [
        reading(scene, quantity=quantity, factor=factor)
        for scene in scenes
        for quantity in ("luminance", "illuminance")
        for factor in (0.999, 1.001)
    ]


DARKS = tuple(dark(f"dark-{t:g}-{n}", time_s=t) for t in (0.01, 0.025, 0.1, 0.25, 1.0) for n in range(3))
GOOD = (*lights(*LEVELS), *DARKS)
READ = readings_of(*LEVELS)


def advice(rows=GOOD, readings=READ, params=None):
    return plan(rows, readings, params or Params())


def test_a_good_campaign_lacks_nothing():
    assert advice() == ()
    assert luminance.missing(GOOD, READ, Params()) == ()


def test_no_dark_frames():
    assert advice(lights(*LEVELS)) == ("no dark frames at ISO 3200",)
    higher = [light(scene, 8.0, iso=6400.0, luminance=value) for scene, value in LEVELS.items()]
    assert "no dark frames at ISO 6400" in advice((*GOOD, *higher))
    assert "no dark frames at ISO 3200" not in advice((*GOOD, *higher))


def test_few_dark_frames():
    rows = (*lights(*LEVELS), dark("d1", time_s=0.1), dark("d2", time_s=0.1))
    assert advice(rows)[0] == "fewer than three dark frames at ISO 3200: add some at other apertures"
    three = (*rows, dark("d3", time_s=0.1))
    assert not any("fewer than three" in sentence for sentence in advice(three))


def test_dark_frames_at_another_time():
    rows = (*lights(*LEVELS), *(dark(f"d{n}", time_s=0.1) for n in range(3)))
    (sentence,) = advice(rows)
    assert sentence.startswith("no dark frames at ISO 3200 with a like exposure time: No dark frame within")
    assert sentence.endswith("the exposure time 1/100 s, …, 1 s")


def test_dark_frames_that_differ():
    rows = (*GOOD, *(dark(f"d{n}", mean_dn=290.0, time_s=0.1) for n in range(4)))
    assert "the dark frames at ISO 3200 differ too much for its weakest signal: repeat them" in advice(rows)


@pytest.mark.parametrize(
    ("scenes", "f_numbers", "lacking"),
    [
        ("abe", (5.6, 8.0), "3 usable levels, add 2 more between 0.5 and 20 cd/m2"),
        ("bc", (4.0, 5.6, 8.0), "2 usable levels, add 3 more down to 2 cd/m2 or up to 50 cd/m2"),
        (
            "c",
            (4.0, 5.0, 5.6, 6.3, 8.0, 10.0),
            "1 usable level, add 4 more down to 0.5 cd/m2 or up to 50 cd/m2",
        ),
    ],
)
def test_levels_are_to_be_added_in_the_widest_gap_and_where_they_lie_close(scenes, f_numbers, lacking):
    kept = (*lights(*scenes, f_numbers=f_numbers), *DARKS)
    assert advice(kept, readings_of(*scenes)) == (f"ISO 3200: {lacking}",)
    assert not any("level" in sentence for sentence in advice(kept, []))
    # what two ISO values lack is said once
    both = [*kept, *(replace(row, exposure=replace(row.exposure, iso=1600.0)) for row in kept)]
    assert advice(both, readings_of(*scenes)) == (f"ISO 1600, 3200: {lacking}",)


@pytest.mark.parametrize(("darkest", "found"), [(0.51, True), (0.49, False)])
def test_a_narrow_span_asks_for_a_darker_level(darkest, found):
    """Five levels up to 5 cd/m2."""
    levels = {"a": 5.0, "b": 4.0, "c": 3.0, "d": 2.0, "e": darkest}
    readings = [reading(scene, value) for scene, value in levels.items()]
    sentence = f"add a darker level at ISO 3200, 0.5 cd/m2 or less: it has {darkest} to 5 cd/m2"
    assert (sentence in advice((*lights(*levels, levels=levels), *DARKS), readings)) is found


def test_one_aperture_only():
    kept = (*lights(*LEVELS, f_numbers=(8.0,)), *DARKS)
    assert advice(kept) == (
        "one aperture only at ISO 3200 (f/8): its f-number error cannot average out",
        "ISO 3200: 5 usable frames, add 1 more",
    )


def test_six_frames_are_enough():
    exclude = tuple(Exclusion(frame=row.frame, reason="", by="me") for row in GOOD[:4])
    params = replace(Params(), exclude=exclude)
    assert not any("usable frames" in sentence for sentence in advice(params=params))
    params = replace(Params(), exclude=(*exclude, Exclusion(frame=GOOD[4].frame, reason="", by="")))
    assert "ISO 3200: 5 usable frames, add 1 more" in advice(params=params)


def test_a_reading_in_foot_lamberts():
    """One fL is 3.4263 cd/m2: typed as cd/m2, the reading is that much too low, and no fit begins."""
    readings = [
        replace(r, value=r.value / 3.4263) if (r.scene, r.quantity) == ("c", "luminance") else r for r in READ
    ]
    assert advice(readings=readings) == ()
    off, again = luminance.missing(GOOD, readings, Params())
    assert off == "scene c: 1.46 cd/m2, its frames say 5: check it, and its unit"
    assert (off.finding, off.subjects, again.subjects) == (codes.READING_OFF, ("scene c",), ("scene c",))
    assert off.values == pytest.approx({"reading_cd_m2": 5.0 / 3.4263, "frames_cd_m2": 5.0}, rel=0.02)


def test_a_reading_that_was_kept_is_named_by_the_fit():
    wrong = [reading(scene, LEVELS[scene] * (10.0 if scene == "c" else 1.0)) for scene in LEVELS]
    assert [cause.finding for cause in luminance.missing(GOOD, wrong, Params())] == [codes.READING_OFF]
    kept = [replace(r, reason="ND filter") if r.scene == "c" else r for r in wrong]
    assert luminance.missing(GOOD, kept, Params()) == ()
    assert not any("frames say" in sentence for sentence in advice(readings=kept))
    found = [
        raised for raised in luminance.fit(GOOD, kept, Params()).flags if raised.flag == codes.READING_OFF
    ]
    assert [raised.detail for raised in found] == [
        "scene c: 50 cd/m2, its frames say 5. It was kept: ND filter."
    ]


@pytest.mark.parametrize(
    ("typed", "off"),
    [
        ({"b": "a", "c": "b", "d": "c", "e": "d"}, "bcde"),  # begun a row low
        ({"a": "a", "b": "b", "d": "c", "e": "d"}, "de"),  # a row was skipped
        ({"a": "a", "b": "a", "c": "b", "d": "c", "e": "d"}, "bcde"),  # a value was typed twice
        ({"a": "a", "b": "c", "c": "d", "d": "e"}, "bcd"),  # a value was left out
    ],
)
def test_a_list_that_is_typed_a_row_off(typed, off):
    """Where more readings are wrong than right, the right ones are not doubted."""
    found = luminance.missing(GOOD, [reading(scene, LEVELS[of]) for scene, of in typed.items()], Params())
    assert [cause for cause in found if cause.finding is codes.READING_OFF] == [
        f"scene {scene}: {LEVELS[typed[scene]]:g} cd/m2, its frames say {LEVELS[scene]:g}, "
        f"and it fits scene {typed[scene]}: check its row"
        for scene in off
    ]


@pytest.mark.parametrize(
    ("factor", "found"), [(1.23, False), (1.27, True), (1 / 1.23, False), (1 / 1.27, True)]
)
def test_a_reading_may_differ_from_the_others(factor, found):
    readings = [replace(r, value=r.value * factor) if r.scene == "c" else r for r in READ]
    assert any("scene c: " in sentence for sentence in advice(readings=readings)) is found


def test_one_reading_per_scene():
    once = [r for index, r in enumerate(READ) if index % 2 == 0]
    drift = "one reading of scenes {}: a lamp that drifts is not seen, read again after the frames"
    assert advice(readings=once) == (
        "only one reading per scene: repeatability cannot be seen",
        drift.format("a, b, c and 2 more"),
    )
    assert advice(readings=[*once, *(reading(each) for each in "cde")]) == (drift.format("a, b"),)


def test_readings_of_a_scene_without_frames_show_nothing():
    once = [r for index, r in enumerate(READ) if index % 2 == 0]
    elsewhere = [replace(r, scene="elsewhere") for r in READ[:4]]
    assert advice(readings=[*once, *elsewhere]) == advice(readings=once)


def test_a_lamp_that_drifts():
    drifted = [replace(r, value=r.value * 1.03) if r is READ[3] else r for r in READ]
    assert advice(readings=drifted) == ("the lamp drifted in scene a: repeat its frames and readings",)


def test_luminance_against_illuminance():
    """Illuminances equal luminances in number: rho = pi agrees, rho = 1 does not."""
    found = advice(params=replace(Params(), panel_rho=1.0))
    assert found[0] == "luminance and illuminance of scene a disagree: check both readings and rho"
    assert len(found) == 5


def test_a_meter_without_a_certificate():
    bare = [replace(r, expanded_uncertainty_rel=None) for r in READ]
    assert advice(readings=bare) == (
        "the meter meter 1 has no certificate: its calibration uncertainty is not in that of K",
    )
    unnamed = [replace(r, meter=None) for r in bare]
    assert advice(readings=unnamed) == (
        "some luminance readings name no meter: its calibration uncertainty is not in that of K",
    )


def test_an_empty_campaign_gets_no_advice():
    """What it lacks is in the other list."""
    assert advice((), []) == ()


def test_times_that_catch_a_part_of_the_mains_period_are_named():
    stated = Params(mains_frequency_hz=50.0)
    # 0.01, 0.1 and 1 s are whole multiples of 1/100 s, 0.025 and 0.25 s of 1/40 s
    times = {
        candidate.settings.exposure_time_s
        for one in collect_series(GOOD, READ, stated)
        for candidate in one.used
    }
    found = [each for each in advice(params=stated) if "mains" in each]
    assert len(found) == len([t for t in times if abs(t * 100 - round(t * 100)) > 1e-9 and t < 0.3])
    assert all("use multiples of 1/100 s" in each for each in found)
    assert advice(params=replace(stated, lamp_modulation=0.0)) == ()


def test_known_response_asks_for_the_lamp():
    known = Params(camera_response="Nikon D5100")
    (lamp,) = advice(params=known)
    assert lamp == "the lamp is not stated: without it no spectral mismatch can be corrected"
    assert lamp.finding.code == "spectral_mismatch_unknown"
    assert advice(params=replace(known, lamp="A")) == ()
