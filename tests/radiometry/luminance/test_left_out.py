"""Points that a fit leaves out, each with its reason, and what keeps it from starting."""

import dataclasses

import pytest

from radiometry.findings import InputRejected, shared
from radiometry.fitting.evidence import Exclusion
from radiometry.luminance import codes
from radiometry.luminance import method as luminance
from radiometry.luminance.suggestions import plan
from tests.radiometry.luminance.exact import (
    DARK,
    DARKS,
    LIGHTS,
    PARAMS,
    READINGS,
    ROWS,
    K,
    dark,
    fit,
    light,
    point,
    statistics,
)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"statistics": statistics(3000.0, saturated=0.0011)}, "0.11% of its samples are saturated"),
        ({"statistics": statistics(DARK + 0.3)}, "less than 3 standard errors above dark"),
        ({"scene": "unread"}, "no luminance reading"),
    ],
)
def test_a_point_is_left_out_with_its_reason(changes, reason):
    result = fit((*ROWS, dataclasses.replace(light("dim", 11.0, name="odd"), **changes)))
    odd = point(result, "odd")
    assert not odd.used
    assert reason in odd.left_out
    assert (odd.weight, odd.residual_rel) == (0.0, None)
    assert result.iso_fits[0].coefficient.luminance_k == pytest.approx(K, rel=1e-9)


def test_a_thousandth_saturated_still_counts():
    rows = (*ROWS, light("dim", 11.0, name="odd"))
    kept = dataclasses.replace(rows[-1].statistics[0], saturated_share=0.001)
    assert point(fit((*rows[:-1], dataclasses.replace(rows[-1], statistics=(kept,)))), "odd").used


def test_a_frame_excluded_by_hand_says_who_and_why():
    exclude = (Exclusion(frame="odd", reason="someone walked past", by="R. Ecorder"),)
    rows = (*ROWS, light("dim", 11.0, k=99.0, name="odd"))
    result = fit(rows, params=dataclasses.replace(PARAMS, exclude=exclude))
    assert point(result, "odd").left_out == "excluded by R. Ecorder: someone walked past"
    assert result.iso_fits[0].coefficient.luminance_k == pytest.approx(K, rel=1e-9)


def test_an_excluded_dark_frame_does_not_count():
    exclude = (Exclusion(frame="lit", reason="lamp was on", by="me"),)
    rows = (*LIGHTS, *DARKS[:1], dark("lit", mean_dn=900.0))
    result = fit(rows, params=dataclasses.replace(PARAMS, exclude=exclude))
    assert result.iso_fits[0].coefficient.dark_signal_dn == DARK


def test_nothing_is_missing():
    assert luminance.missing(ROWS, READINGS, PARAMS) == ()


@pytest.mark.parametrize(
    ("rows", "readings", "sentence"),
    [
        (DARKS, READINGS, "the campaign has no light frame"),
        (
            (*ROWS, light("dim", 11.0, name="new", statistics=None)),
            READINGS,
            "no statistics yet: frame new",
        ),
        (
            (*ROWS, dataclasses.replace(light("dim", 11.0, name="new"), scene=None)),
            READINGS,
            "no scene: frame new",
        ),
        (
            tuple(row for row in ROWS if row.scene != "bright"),
            READINGS,
            "ISO 3200 has 2 usable scenes, a fit needs 3: photograph more light levels",
        ),
        (LIGHTS[:6], READINGS, "ISO 3200 has 2 usable scenes, a fit needs 3: photograph more light levels"),
    ],
)
def test_what_keeps_a_fit_from_starting_is_said_by_name(rows, readings, sentence):
    assert any(found.startswith(sentence) for found in luminance.missing(rows, readings, PARAMS))
    with pytest.raises(InputRejected) as refusal:
        fit(rows, readings)
    assert refusal.value.code is shared.FIT_INCOMPLETE
    assert sentence in refusal.value.message


def test_frames_that_are_still_measured_are_no_missing_light_levels():
    rows = tuple(dataclasses.replace(row, statistics=None) if row.scene != "dim" else row for row in LIGHTS)
    assert [each for each in luminance.missing(rows, READINGS, PARAMS) if "usable" in each] == []


def test_a_scene_without_a_reading_is_named_and_does_not_stop_the_others():
    scenes = ("level-10", "level-2")
    rows = (*ROWS, *(dataclasses.replace(light("dim", 11.0, name=each), scene=each) for each in scenes))
    (unread,) = luminance.missing(rows, READINGS, PARAMS)
    assert unread == "scenes level-2 and level-10 have no luminance reading"
    assert (unread.finding, unread.subjects) == (codes.READING_MISSING, ("scene level-2", "scene level-10"))
    assert fit(rows).passed


def test_scenes_that_lack_readings_alone_are_one_cause():
    """As of a card whose scenes were proposed, and whose readings have other names: no level is missing."""
    names = {scene: f"Scene {n}" for n, scene in enumerate(("bright", "middle", "dim"), start=1)}
    rows = [dataclasses.replace(row, scene=names.get(row.scene)) for row in ROWS]
    assert luminance.missing(rows, READINGS, PARAMS) == ("scenes 1 to 3 have no luminance reading",)
    assert not [each for each in plan(rows, READINGS, PARAMS) if "level" in each]
    with pytest.raises(InputRejected, match="ISO 3200 has 0 usable scenes"):
        luminance.fit(rows, READINGS, PARAMS)


def test_a_scene_of_which_every_frame_is_excluded_needs_no_reading():
    rows = (*ROWS, dataclasses.replace(light("dim", 11.0, name="new"), scene="level-4"))
    params = dataclasses.replace(PARAMS, exclude=(Exclusion(frame="new", reason="", by="me"),))
    assert luminance.missing(rows, READINGS, params) == ()


def test_a_campaign_without_a_region_says_so_once():
    bare = [dataclasses.replace(row, statistics=None, has_region=False) for row in ROWS]
    assert luminance.missing(bare, READINGS, PARAMS) == ("the campaign has no region (ROI)",)
    assert luminance.missing((*bare[:1], *ROWS[1:]), READINGS, PARAMS) == (
        "no region (ROI): frame bright-3200-5.6",
    )


def test_the_first_of_many_waiting_frames_are_named_and_the_rest_counted():
    waiting = [dataclasses.replace(row, statistics=None) for row in ROWS]
    assert luminance.missing(waiting, READINGS, PARAMS) == (
        "no statistics yet: frames bright-3200-5.6, bright-3200-8, bright-3200-16 and 12 more",
    )
    assert luminance.missing((*waiting[:2], *ROWS[2:]), READINGS, PARAMS) == (
        "no statistics yet: frames bright-3200-5.6, bright-3200-8",
    )


def test_what_is_not_read_yet_is_named_and_may_be_the_light_frames():
    assert luminance.missing((), (), PARAMS, unread=("b", "a")) == ("not read yet: frames a, b",)
    assert luminance.missing((), (), PARAMS) == ("the campaign has no light frame",)


def test_excluding_an_unknown_frame_is_said():
    params = dataclasses.replace(PARAMS, exclude=(Exclusion(frame="ghost", reason="", by="me"),))
    assert luminance.missing(ROWS, READINGS, params) == (
        "to be left out, but not of this campaign: frame ghost",
    )


def test_an_excluded_frame_need_not_be_extracted():
    params = dataclasses.replace(PARAMS, exclude=(Exclusion(frame="new", reason="blurred", by="me"),))
    assert luminance.missing((*ROWS, light("dim", 11.0, name="new", statistics=None)), READINGS, params) == ()
