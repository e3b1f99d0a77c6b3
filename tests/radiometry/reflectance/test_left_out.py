"""Panel captures that a fit leaves out, flags or refuses, and what it lacks."""

import dataclasses
import math

import numpy as np
import pytest

from radiometry.findings import InputRejected
from radiometry.fitting.evidence import Exclusion
from radiometry.reflectance import method as reflectance
from simulation.sequoia import capture
from tests.radiometry.reflectance.captures import (
    CAMERA,
    PANEL_R,
    READINGS,
    change_band,
    change_features,
    flags_of,
    k_of,
    make_header,
    panel,
    row,
    seeded,
    take,
)

PARAMS = reflectance.Params()


def test_a_saturated_panel_is_left_out_by_name():
    bright = capture(CAMERA, seeded(), reflectance={"green": 0.6})["green"]
    rows = [row("bright", bright), *panel()[:1]]
    found = reflectance.fit(rows, READINGS, PARAMS)
    points = {point.frame: point for point in found.points}
    assert not points["bright"].used
    assert points["bright"].left_out.startswith("saturated")
    assert points["bright"].saturated_share > 0.5
    assert "panel_saturated" in flags_of(found.flags)
    with pytest.raises(InputRejected, match=r"saturated: .* of the region\. Take the panel again") as refusal:
        reflectance.fit(rows[:1], READINGS, PARAMS)
    assert refusal.value.code == "panel_saturated"


def test_an_uneven_panel_is_flagged_and_counted():
    ramp = np.tile(0.18 * (1 + 0.06 * (np.arange(160) - 80) / 60), (120, 1))
    rows = take(seeded(), {"green": ramp, "red": 0.18})
    found = reflectance.fit(rows, READINGS, PARAMS)
    uneven = [raised for raised in found.flags if raised.flag == "panel_uneven"]
    assert [raised.where for raised in uneven] == ["band green"]
    shares = {entry.source: entry.u_rel for entry in k_of(found).budget}
    assert shares["panel evenness"] == pytest.approx(0.06 * 59 / 60 / math.sqrt(12), rel=0.1)


def test_a_dark_panel_is_left_out():
    rows = change_features(panel()[:1], i_sq=0.001, i_sq_standard_uncertainty=0.001)
    with pytest.raises(InputRejected, match="three standard errors"):
        reflectance.fit(rows, READINGS, PARAMS)


def test_saturated_or_unknown_sunshine_is_an_error_by_name():
    for gains, match in (((3,) * 10, "saturated count|unknown gain"), ((1,) * 0, "the list is empty")):
        with pytest.raises(InputRejected, match=match) as refusal:
            reflectance.fit(panel(gain_indices=gains), READINGS, PARAMS)
        assert refusal.value.code == "sunshine_missing"


def test_some_saturated_readings_are_left_out_and_flagged():
    found = reflectance.fit(panel(gain_indices=(1, 3, 1, 3, 1)), READINGS, PARAMS)
    raised = [each for each in found.flags if each.flag == "sunshine_readings_left_out"]
    assert len(raised) == 4
    assert "2 of 5" in raised[0].detail


def test_a_capture_that_lacks_a_band_is_flagged():
    rows = [*panel(), *(each for each in panel(2, minutes=20.0) if "nir" not in each.frame)]
    found = reflectance.fit(rows, READINGS, PARAMS)
    missing = [each for each in found.flags if each.flag == "band_missing"]
    assert [(each.where, each.detail) for each in missing] == [("capture panel-20", "Not there: nir.")]


def test_a_band_without_a_reflectance_is_named_and_left_out():
    readings = [reading for reading in READINGS if reading.band != "nir"]
    assert reflectance.missing(panel(), readings, PARAMS) == (
        f"panel {readings[0].panel} has no reflectance (band nir): register it with what it reflects there",
    )
    assert "register the panel" in reflectance.missing(panel(), (), PARAMS)[0]
    found = reflectance.fit(panel(), readings, PARAMS)
    assert [each.coefficient.band for each in found.band_fits] == ["green", "red", "red_edge"]
    (left_out,) = [point for point in found.points if not point.used]
    assert (left_out.band, left_out.left_out) == ("nir", "no reflectance of the panel in this band")


def test_two_panels_contradict_each_other():
    twice = [*READINGS, dataclasses.replace(READINGS[0], panel="P2", reflectance=0.5)]
    with pytest.raises(InputRejected, match="2 different panel reflectances"):
        reflectance.fit(panel(), twice, PARAMS)


def test_panel_frames_of_two_cameras_are_refused():
    other = [
        dataclasses.replace(each, header=dataclasses.replace(each.header, serial="OTHER"))
        for each in panel(2, minutes=20.0)
    ]
    with pytest.raises(InputRejected, match="several cameras") as refusal:
        reflectance.fit([*panel(), *other], READINGS, PARAMS)
    assert refusal.value.code == "wrong_camera"


def test_panel_frames_of_two_sunshine_sensors_are_refused_unless_it_is_left_out():
    rows = [*panel(), *change_band(panel(2, minutes=20.0), sunshine_serial="OTHER")]
    with pytest.raises(InputRejected, match="several sunshine sensors") as refusal:
        reflectance.fit(rows, READINGS, PARAMS)
    assert refusal.value.code == "wrong_sunshine_sensor"
    assert reflectance.fit(rows, READINGS, reflectance.Params(normalisation="panel_only"))


def test_what_a_fit_still_lacks_is_named():
    rows = panel()
    waiting = dataclasses.replace(rows[0], features=None)
    regionless = dataclasses.replace(rows[1], features=None, has_region=False)
    params = reflectance.Params(exclude=(Exclusion(frame="nobody", reason="blurred", by="Ann"),))
    lacking = reflectance.missing([waiting, regionless, *rows[2:]], READINGS, params, unread=["new"])
    assert lacking == (
        "to be left out, but not of this campaign: frame nobody",
        "not read yet: frame new",
        "no region on the panel: frame panel-0-red",
        "not extracted yet: frame panel-0-green",
    )
    assert reflectance.missing((), (), PARAMS) == ("the campaign has no panel frame",)
    with pytest.raises(InputRejected, match="cannot start: not extracted yet: frame panel-0-green"):
        reflectance.fit([waiting], READINGS, PARAMS)


def test_an_excluded_frame_stays_in_the_record():
    rows = [*panel(), *panel(2, minutes=1.0)]
    params = reflectance.Params(exclude=(Exclusion(frame="panel-1-green", reason="shadow", by="Ann"),))
    found = reflectance.fit(rows, READINGS, params)
    (point,) = [each for each in found.points if not each.used]
    assert (point.frame, point.left_out) == ("panel-1-green", "shadow (Ann)")


def test_field_frames_are_not_looked_at():
    field = take(seeded(5), PANEL_R, role="field", minutes=5.0)
    assert reflectance.fit([*panel(), *field], READINGS, PARAMS) == reflectance.fit(panel(), READINGS, PARAMS)


def test_a_file_of_another_kind_is_no_panel_frame():
    other = dataclasses.replace(panel()[0], header=make_header(None))
    with pytest.raises(InputRejected, match="none of the panel frames") as refusal:
        reflectance.fit([other], READINGS, PARAMS)
    assert refusal.value.code == "fit_incomplete"


def test_frames_say_what_is_odd_about_their_files():
    (first, *_) = panel()
    model = dataclasses.replace(first.header.multispectral.sensor_model, a=3.1e8)
    (newer,) = change_band([first], sensor_model=model)
    header = dataclasses.replace(newer.header, black_level_dn=(3067.5,), serial=None)
    odd = dataclasses.replace(newer, header=header)
    (odd,) = change_band([odd], sunshine_serial=None)
    found = reflectance.fit([odd], READINGS, PARAMS)
    assert {
        "sensor_model_scale",
        "black_level_disagrees",
        "serial_unknown",
        "sunshine_serial_unknown",
    } <= flags_of(found.flags)
    usual = flags_of(reflectance.fit([first], READINGS, PARAMS).flags)
    assert usual == {"panel_once", "panel_not_identified"}
