"""The panel of a fit: another one is refused, and its values are those of the frames' day."""

from dataclasses import replace
from datetime import UTC, datetime

import pytest

from radiometry.findings import InputRejected
from radiometry.fitting.evidence import Exclusion
from radiometry.frame.multispectral import Multispectral, name_panel
from radiometry.reflectance import method as reflectance
from radiometry.reflectance.findings import judge
from radiometry.reflectance.panel_code import FoundPanel
from radiometry.reflectance.points import find_value
from tests.radiometry.evidence import taken
from tests.radiometry.reflectance.captures import PANEL_R, READINGS, change_band, flags_of, k_of, panel

PARAMS = reflectance.Params()
OWN, OTHER = "RP04-1901231-SC", "RP02-1603036-SC"
OURS = [replace(each, panel=OWN) for each in READINGS]


def read_codes(rows, serial):
    return [replace(each, identified=serial) for each in rows]


@pytest.mark.parametrize("by", ["code", "tags"])
def test_another_panel_than_the_campaign_s_is_refused_by_both_names(by):
    """Real: a panel of 0.53 taken for one of 0.244 gave a K that was 2.17 times too small, in silence."""
    rows = panel()
    shown = read_codes(rows, OTHER) if by == "code" else change_band(rows, panel_serial=OTHER)
    with pytest.raises(InputRejected, match=f"panel {OTHER}, and the campaign's panel is {OWN}") as refused:
        reflectance.fit(shown, OURS, PARAMS)
    assert refused.value.code == "panel_differs"


def test_one_frame_of_another_panel_is_enough_unless_it_is_left_out():
    rows = panel()
    mixed = [*read_codes(rows[:1], OTHER), *rows[1:]]
    with pytest.raises(InputRejected, match=OTHER):
        reflectance.fit(mixed, OURS, PARAMS)
    exclusion = Exclusion(frame=rows[0].frame, reason="another panel", by="A")
    assert len(reflectance.fit(mixed, OURS, replace(PARAMS, exclude=(exclusion,))).band_fits) == len(rows) - 1
    bare = [
        replace(each, identified=serial) for each, serial in zip(rows, (OTHER, OWN, OWN, OWN), strict=True)
    ]
    with pytest.raises(InputRejected, match=f"{OTHER}, frame .* panel {OWN}"):
        reflectance.fit(change_band(bare, panel_albedo=0.5), (), PARAMS)


def test_a_file_that_contradicts_its_image_is_refused():
    rows = change_band(read_codes(panel(), OWN), panel_serial=OTHER)
    with pytest.raises(InputRejected, match="in its tags and by its code"):
        reflectance.fit(rows, OURS, PARAMS)


@pytest.mark.parametrize("written", [OWN, f" {OWN.lower()} ", f"{OWN}_04000500900049"])
def test_a_panel_is_known_by_every_way_to_write_it(written):
    assert name_panel(written) == OWN
    fitted = reflectance.fit(read_codes(panel(), written), OURS, PARAMS)
    assert "panel_not_identified" not in flags_of(fitted.flags)
    assert "panel_not_identified" in flags_of(reflectance.fit(panel(), OURS, PARAMS).flags)


def test_the_verdict_names_both_panels_before_any_fit():
    rows = read_codes(panel(), OTHER)
    for verdict in judge([taken(each) for each in rows], rows, OURS, PARAMS).values():
        assert any(each.code == "panel_differs" and OTHER in each.detail for each in verdict.reasons)


@pytest.mark.parametrize(
    ("text", "wavelength_nm", "albedo"),
    [
        (f"{OWN}_04000530100005", None, None),
        (f"{OWN}_04004700850490", 475.0, 0.4733),
        (f"{OWN}_04004700850490", 840.0, 0.4896),
        (f"{OWN}_04004700850490", 900.0, None),
        (OWN, 475.0, None),
    ],
)
def test_a_code_s_own_reflectances_are_read_on_their_line(text, wavelength_nm, albedo):
    found = FoundPanel(region=None, serial=OWN, text=text).read_albedo(wavelength_nm)
    assert found == (albedo and pytest.approx(albedo, abs=1e-4))


def value(day, *measured, named=None):
    readings = [
        reflectance.Reading(panel=OWN, band="green", reflectance=r, standard_uncertainty=u, measured_on=on)
        for on, r, u in measured
    ]
    band = Multispectral(system="sequoia", band="green", band_name="Green")
    at = datetime.fromisoformat(day).replace(tzinfo=UTC) if day else None
    return find_value(band, readings, replace(PARAMS, panel_measured_on=named), at=at)


NEW, USED = ("2020-01-01", 0.50, 0.005), ("2022-01-01", 0.48, 0.003)


def test_between_two_measurements_the_value_is_interpolated():
    """Half-way u is the mean of both, and half of the change: a step may have come before or after."""
    found = value("2021-01-01", USED, NEW)
    w = 366 / 731
    assert found.reflectance == pytest.approx(0.50 - 0.02 * w)
    assert found.standard_uncertainty == pytest.approx((0.004**2 + 0.02**2 / 4) ** 0.5, rel=1e-3)
    assert (found.measured_on, found.age_days) == (("2020-01-01", "2022-01-01"), 0.0)
    assert value("2020-01-01", USED, NEW).standard_uncertainty == pytest.approx(0.005)


def test_after_the_last_measurement_its_value_holds_and_its_rate_of_change_widens_it():
    found = value("2023-01-01", NEW, USED)
    assert found.reflectance == 0.48
    assert found.standard_uncertainty == pytest.approx((0.003**2 + (0.02 / 731 * 365) ** 2) ** 0.5)
    assert (found.measured_on, found.age_days) == (("2022-01-01",), 365.0)
    assert value("2019-01-01", NEW, USED).measured_on == ("2020-01-01",)


def test_a_named_measurement_is_taken_alone_and_a_clock_of_1970_takes_the_last():
    assert value("2021-01-01", NEW, USED, named="2020-01-01").reflectance == 0.50
    assert value("1970-01-01", NEW, USED).measured_on == ("2022-01-01",)
    assert value(None, NEW, USED).measured_on == ("2022-01-01",)


def test_a_named_measurement_that_is_not_registered_is_missing_by_its_day():
    params = replace(PARAMS, panel_measured_on="2019-05-05")
    dated = [replace(each, measured_on="2018-03-01") for each in OURS]
    (said, *_) = reflectance.missing(panel(), dated, params)
    assert "no measurement of 2019-05-05: name one of 2018-03-01" in said


@pytest.mark.parametrize(("day", "old"), [("2016-06-14", False), ("2016-06-12", True)])
def test_a_panel_measured_more_than_two_years_before_is_flagged(day, old):
    """The frames are of 2018-06-13."""
    fitted = reflectance.fit(panel(), [replace(each, measured_on=day) for each in OURS], PARAMS)
    assert ("panel_old" in flags_of(fitted.flags)) == old
    coefficient = k_of(fitted).coefficient
    assert (coefficient.panel_measured_on, coefficient.panel_reflectance) == ((day,), PANEL_R["green"])


def test_the_change_of_the_panel_is_in_the_budget():
    """A panel that lost 10 % between measurements a year before and a year after the flight."""
    later = [replace(r, measured_on="2019-06-13", reflectance=0.9 * r.reflectance) for r in OURS]
    around = [*(replace(each, measured_on="2017-06-13") for each in OURS), *later]
    budget = k_of(reflectance.fit(panel(), around, PARAMS)).budget
    (line,) = (each for each in budget if each.source == "panel reflectance")
    assert line.u_rel == pytest.approx(((0.002 / 0.171) ** 2 + (0.018 / 0.171) ** 2 / 4) ** 0.5, rel=1e-3)
