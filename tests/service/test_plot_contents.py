"""What plots are made of, computed by hand: no picture is drawn, and no browser is needed."""

import math
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from types import SimpleNamespace

import pytest

from radiometry.fleet.determinations import Determination, Key, Source
from radiometry.fleet.drawing import build_drift, build_fleet
from radiometry.methods import get_method
from service.pages.cameras import build_lives, build_values


def figures(method, name, result, rows=()):
    (plot,) = (each for each in get_method(method).plots if each.name == name)
    return list(plot.build(result, lambda: rows))


def points(series):
    return [(mark.x, mark.y, mark.low, mark.high) for mark in series.marks]


def quantity(value, u, unit="1"):
    return {"value": value, "standard_uncertainty": u, "unit": unit}


@dataclass
class Dark:
    """A frame as the fit takes it."""

    frame: str
    iso: float
    exposure_time_s: float
    taken_at: str | None
    value_dn: float
    role: str = "dark"
    statistics: bool = True

    @property
    def exposure(self):
        return SimpleNamespace(iso=self.iso, exposure_time_s=self.exposure_time_s)

    def measure(self, channel):
        assert channel == "G"
        return SimpleNamespace(value_dn=self.value_dn, standard_uncertainty_dn=0.5)


def luminance(*isos, apertures=()):
    fits = [
        {
            "coefficient": {
                "iso": iso,
                "channel": "G",
                "luminance_k": k,
                "expanded_uncertainty": 0.4,
                "luminance_k_unit": "DN*m2/(cd*s)",
                "apertures": list(apertures),
            }
        }
        for iso, k in isos
    ]
    return {"iso_fits": fits, "points": [{"iso": iso, "scene": "a", "rhs": None} for iso, _ in isos]}


def test_signal_against_ln_x_has_the_line_of_the_procedure_and_each_point():
    """Figure 10: N = 40 ln X + 100 is a straight line over the logarithm, whatever model K is of."""
    result = luminance((100.0, 2.0))
    point = {"iso": 100.0, "scene": "a", "frame": "f", "f_number": 4.0, "exposure_time_s": 0.1}
    point |= {"luminance_cd_m2": 1.0, "used": True, "left_out": "", "residual_rel": 0.0}
    result["points"] = [point | {"rhs": x, "adjusted_signal_dn": 2.0 * x} for x in (1.0, 10.0, 100.0)]
    result["iso_fits"][0]["models"] = [{"model": "semilog", "parameters": [40.0, 100.0]}]
    result["iso_fits"][0]["coefficient"] |= {"model": "proportional", "parameters": [2.0]}
    (figure,) = (each for each in figures("luminance", "signal", result) if each.part == "Semilogarithmic")
    (series,) = figure.series
    assert (figure.x.logarithmic, figure.y.logarithmic) == (True, False)
    assert [(mark.x, mark.y) for mark in series.marks] == [(1.0, 2.0), (10.0, 20.0), (100.0, 200.0)]
    assert [y - 40.0 * math.log(x) for x, y in series.model] == pytest.approx([100.0] * len(series.model))
    result["iso_fits"][0]["models"] = []
    assert figures("luminance", "signal", result)[2].series[0].model == ()


def test_dark_signal_against_iso_exposure_and_time_has_each_dark_frame_with_two_u():
    result = luminance((100.0, 32.0), (800.0, 31.0))
    rows = [
        Dark("a", 100.0, 0.01, "2026-03-29T01:30:00+01:00", 64.0),
        Dark("b", 800.0, 0.5, "2026-03-29T03:30:00+02:00", 70.0),
        Dark("c", 800.0, 2.0, None, 75.0),
        Dark("flat", 100.0, 0.01, None, 900.0, role="light"),
        Dark("unread", 100.0, 0.01, None, 65.0, statistics=False),
        Dark("other ISO", 400.0, 0.01, None, 66.0),
    ]
    (by_iso,) = figures("luminance", "dark-iso", result, rows)
    assert [each.name for each in by_iso.series] == ["ISO 100", "ISO 800"]
    assert [points(each) for each in by_iso.series] == [
        [(100.0, 64.0, 63.0, 65.0)],
        [(800.0, 70.0, 69.0, 71.0), (800.0, 75.0, 74.0, 76.0)],
    ]
    (by_exposure,) = figures("luminance", "dark-exposure", result, rows)
    assert [mark.x for each in by_exposure.series for mark in each.marks] == [0.01, 0.5, 2.0]
    assert by_exposure.x.ticks == ((0.01, "1/100 s"), (0.5, "0.5 s"), (2.0, "2 s"))
    assert by_exposure.series[0].marks[0].told == ("1/100 s, ISO 100", "64.0 ± 1.0 DN (95 %)")
    # an hour passed, though clocks were put forward; a frame without a time is in the others alone
    (by_time,) = figures("luminance", "dark-time", result, rows)
    (first,), (second,) = (each.marks for each in by_time.series)
    assert (second.x - first.x, second.name) == (3600.0, "b")
    assert figures("luminance", "dark-time", result, rows[3:]) == []
    # of one exposure time nothing is seen that would depend on it
    assert figures("luminance", "dark-exposure", result, rows[:1]) == []


def test_k_of_each_aperture_has_its_interval_above_that_of_all():
    aperture = [
        {"f_number": f_number, "luminance_k": k, "expanded_uncertainty": 0.6}
        for f_number, k in ((2.8, 32.5), (5.6, 31.5))
    ]
    (figure,) = figures("luminance", "apertures", luminance((100.0, 32.0), apertures=aperture))
    (series,) = figure.series
    assert points(series) == [
        pytest.approx((32.5, 0.0, 31.9, 33.1)),
        pytest.approx((31.5, -1.0, 30.9, 32.1)),
        pytest.approx((32.0, -2.0, 31.6, 32.4)),
    ]
    assert [text for _, text in figure.y.ticks] == ["ISO 100 f/2.8", "ISO 100 f/5.6", "ISO 100 all"]
    assert series.marks[0].told == ("f/2.8: 32.50 ± 0.60 DN·m²/(cd·s) (95 %)",)
    assert figure.x.label == "K [DN·m²/(cd·s)]"
    assert figures("luminance", "apertures", luminance((100.0, 32.0))) == []


def falloff(f_number, lost, channel="G"):
    return {
        "coefficient": {
            "f_number": f_number,
            "channel": channel,
            "corner_falloff": lost,
            "corner_falloff_standard_uncertainty": 0.01,
        }
    }


def test_corner_falls_with_the_aperture_a_line_for_each_channel():
    fits = [falloff(5.6, 0.2), falloff(2.8, 0.4), falloff(2.8, 0.5, "R")]
    (figure,) = figures("vignetting", "corner", {"channel_fits": fits, "thresholds": [{"falloff": 0.1}]})
    green, red = figure.series
    assert [each.name for each in figure.series] == ["G", "R"]
    assert points(green) == [pytest.approx((2.8, 40.0, 38.0, 42.0)), pytest.approx((5.6, 20.0, 18.0, 22.0))]
    assert green.line == ((2.8, 40.0), (5.6, 20.0))
    assert points(red) == [pytest.approx((2.8, 50.0, 48.0, 52.0))]
    assert green.marks[0].told == ("40.0 ± 2.0 %, two standard uncertainties",)
    assert (figure.levels, figure.x.logarithmic) == ((10.0,), True)
    assert figure.x.ticks == ((2.8, "f/2.8"), (5.6, "f/5.6"))


def test_mtf_curves_have_the_colours_of_their_places_on_the_frame():
    def position(name, radius, row, col, mtf50):
        curve = {"frequency": [0.0, 0.5], "response": [1.0, 0.25], "response_u": [0.0, 0.05]}
        return {
            "kind": "slanted_edge",
            "position": name,
            "channel": "G",
            "radius_rel": radius,
            "row_px": row,
            "col_px": col,
            "coefficients": [
                {"name": "mtf50_cycles_per_pixel", "quantity": quantity(mtf50, 0.01, "cycles/px")}
            ],
            "curves": [curve],
        }

    centre, corner = position("centre", 0.0, 100.0, 150.0, 0.31), position("corner", 0.9, 190.0, 290.0, 0.2)
    result = {"positions": [centre, corner]}
    (curves,) = figures("sharpness", "response", result)
    (places,) = figures("sharpness", "places", result)
    assert [(each.name, each.place) for each in curves.series] == [("centre", 0), ("corner", 1)]
    assert [(each.name, each.place) for each in places.series] == [("centre", 0), ("corner", 1)]
    assert curves.series[0].model == ((0.0, 1.0), (0.5, 0.25))
    assert curves.series[0].swath == ((0.0, 1.0, 1.0), (0.5, pytest.approx(0.15), pytest.approx(0.35)))
    (half,) = curves.series[0].marks
    assert (half.x, half.y, half.told) == (0.31, 0.5, ("0.310 ± 0.010 cycles/px",))
    # rows count downwards; the frame's ends are twice its middle
    assert [(mark.x, mark.y) for each in places.series for mark in each.marks] == [
        *((150.0, -100.0), (290.0, -190.0))
    ]
    assert (places.x.include, places.y.include) == ((0.0, 300.0), (0.0, -200.0))


def test_photon_transfer_is_drawn_in_logarithms_with_the_line_of_the_gain():
    levels = [
        {"exposure_time_s": 0.01, "signal_dn": signal, "excess_dn2": variance, "left_out": out}
        for signal, variance, out in ((100.0, 52.0, ""), (1000.0, 490.0, ""), (9000.0, 20.0, "saturated"))
    ]
    # nothing without variance has a place on a logarithmic axis
    levels.append({"exposure_time_s": 0.01, "signal_dn": 50.0, "excess_dn2": -3.0, "left_out": ""})
    fit = {"iso": 100.0, "channel": "G1", "levels": levels}
    fit["transfer"] = {"system_gain_dn_per_e": quantity(0.5, 0.01)}
    (figure,) = figures("noise", "transfer", {"channel_fits": [fit]})
    assert figure.x.logarithmic
    assert figure.y.logarithmic
    (series,) = figure.series
    assert [(mark.x, mark.y) for mark in series.marks] == [(100.0, 52.0), (1000.0, 490.0), (9000.0, 20.0)]
    assert [mark.left_out for mark in series.marks] == ["", "", "saturated"]
    assert all(y == pytest.approx(0.5 * x) for x, y in series.model)
    assert (series.model[0][0], series.model[-1][0]) == pytest.approx((100.0 / 1.5, 13500.0))


def test_panel_visits_are_differences_from_k_of_the_band_in_time():
    c = {"band": "green", "reflectance_k": 10.0, "reflectance_k_unit": "1/s", "interpolation": "linear"}
    c["knots"] = [{"at_s": 100.0, "reflectance_k": 9.0}, {"at_s": 700.0, "reflectance_k": 11.0}]
    frames = [
        {"frame": "a", "band": "green", "used": True, "reflectance_k": 9.0, "at_s": 100.0, "visit": 1},
        {"frame": "b", "band": "green", "used": False, "reflectance_k": 11.5, "at_s": 700.0, "visit": 2},
        {"frame": "c", "band": "green", "used": True, "reflectance_k": None, "at_s": 300.0, "visit": 1},
    ]
    (timed,) = figures("reflectance", "visits", {"band_fits": [{"coefficient": c}], "points": frames})
    (series,) = timed.series
    assert [(m.x, m.y, m.left_out) for m in series.marks] == [
        (100.0, pytest.approx(-10.0), ""),
        (700.0, pytest.approx(15.0), "not used"),
    ]
    assert series.line == ((100.0, pytest.approx(-10.0)), (700.0, pytest.approx(10.0)))
    assert timed.x.is_time
    # without times, by the number of the visit
    untimed = [{**each, "at_s": None} for each in frames]
    (counted,) = figures("reflectance", "visits", {"band_fits": [{"coefficient": c}], "points": untimed})
    assert [mark.x for mark in counted.series[0].marks] == [1.0, 2.0]
    assert (counted.series[0].line, counted.x.is_time) == ((), False)


def test_legends_name_bands_in_words():
    c = {"band": "red_edge", "reflectance_k": 10.0, "reflectance_k_unit": "1/s", "expanded_uncertainty": 0.1}
    c["knots"] = [{"at_s": 100.0, "reflectance_k": 10.0, "u_rel": 0.01}]
    frame = {"frame": "a", "band": "red_edge", "used": True, "reflectance_k": 10.0, "at_s": 100.0, "visit": 1}
    result = {"band_fits": [{"coefficient": c}], "points": [frame]}
    (visits,) = figures("reflectance", "visits", result)
    (bands,) = figures("reflectance", "bands", result)
    (time,) = figures("reflectance", "time", result)
    assert [visits.series[0].name, bands.series[0].name, time.part] == ["red edge"] * 3
    assert bands.series[0].marks[0].name == "band red edge"
    assert visits.series[0].marks[0].told[0] == "band red edge, visit 1"
    keys = [Key(name="reflectance_k", unit="1/s", model="m", band=band) for band in ("red_edge", "nir")]
    rows = [determined(f"v{n}", "c", "2026-05-01", 1.0, key) for n, key in enumerate(keys)]
    drift = build_drift(rows, {"v0": 1, "v1": 1}, quantity="K")
    assert [each.name for each in drift.series] == ["band red edge", "band nir"]


def day(text):
    return datetime.fromisoformat(text).replace(tzinfo=UTC)


def determined(version, camera, at, value, key):
    source = Source(version=version, camera=camera, lens=None, campaign=version, at=day(at))
    return Determination(key=key, value=value, standard_uncertainty=0.05, source=source)


K100 = Key(name="luminance_k", unit="DN*m2/(cd*s)", model="proportional", iso=100.0)
K800 = Key(name="luminance_k", unit="DN*m2/(cd*s)", model="proportional", iso=800.0)


def test_fleet_has_a_line_of_dots_for_each_camera_and_the_mean_dashed():
    found = [
        determined("cal_1", "0K9", "2026-01-01", 31.0, K100),
        determined("cal_2", "0K10", "2026-02-01", 32.0, K100),
        determined("cal_3", "0K10", "2026-03-01", 33.0, K100),
        determined("cal_3", "0K10", "2026-03-01", 30.0, K800),
    ]
    first, second = build_fleet(found, {K100.name: "Luminance K"}.__getitem__)
    assert (first.part, second.part) == ("Luminance K, ISO 100", "Luminance K, ISO 800")
    assert first.y.ticks == ((0.0, "0K9"), (-1.0, "0K10"))
    (series,) = first.series
    assert points(series) == [
        pytest.approx((31.0, 0.0, 30.9, 31.1)),
        pytest.approx((32.0, -0.875, 31.9, 32.1)),
        pytest.approx((33.0, -1.125, 32.9, 33.1)),
    ]
    assert first.uprights == (32.0,)
    assert series.marks[2].told == ("33.000 ± 0.050 DN·m²/(cd·s)", "2026-03-01")
    # a pure number has no unit
    (share,) = build_fleet(
        [determined("cal_1", "a", "2026-01-01", 0.5, Key(name="x", unit="1", model="m"))], str
    )
    assert (share.series[0].marks[0].told[0], share.x.label) == ("0.500 ± 0.050", "x")


def test_drift_has_a_line_for_each_iso_with_one_standard_uncertainty():
    found = [
        determined(version, "0K9", at, value, key)
        for version, at, value in (("cal_1", "2025-01-01", 31.0), ("cal_2", "2026-01-01", 32.0))
        for key in (K100, K800, replace(K800, f_number=4.0))
    ]
    figure = build_drift(found, {"cal_1": 1, "cal_2": 2}, quantity="Luminance K")
    low, high = figure.series
    assert [each.name for each in figure.series] == ["ISO 100", "ISO 800"]
    assert [(m.y, m.low, m.high) for m in low.marks] == [
        pytest.approx((31.0, 30.95, 31.05)),
        pytest.approx((32.0, 31.95, 32.05)),
    ]
    # beside each other, as bars of one day would hide one another
    assert low.marks[0].x < day("2025-01-01").timestamp() < high.marks[0].x
    assert low.marks[1].name == "version 2, ISO 100"
    assert figure.y.label == "Luminance K [DN·m²/(cd·s)]"


def life(version, value, in_force=(), revoked_from=(), published=(), revoked=None):
    def period(first, last):
        return SimpleNamespace(valid_from=day(first), valid_to=day(last) if last else None)

    coefficient = SimpleNamespace(
        name="luminance_k", iso=100.0, value=value, standard_uncertainty=0.05, unit="1"
    )
    return SimpleNamespace(
        calibration=SimpleNamespace(version=version),
        coefficients=[coefficient],
        in_force=[period(*each) for each in in_force],
        revoked_from=[period(*each) for each in revoked_from],
        published=[
            SimpleNamespace(publication=SimpleNamespace(known_from=day(at), reason=reason))
            for at, reason in published
        ],
        revocation=SimpleNamespace(revoked_at=day(revoked), reason="the lamp drifted") if revoked else None,
    )


@pytest.fixture
def lives():
    """Version 2 lay between two that are in force, and was revoked; newest first."""
    return [
        life(3, 33.0, [("2026-05-01", None)], published=[("2026-05-02", "after repair")]),
        life(
            2,
            32.0,
            revoked_from=[("2025-05-01", "2026-05-01")],
            published=[("2025-05-02", "")],
            revoked="2026-06-01",
        ),
        life(1, 31.0, [("2024-05-01", "2025-05-01")], published=[("2024-05-02", "first")]),
    ]


def test_coefficient_in_time_has_each_version_while_it_was_in_force_and_the_revoked_one(lives):
    figure = build_values(lives, {"name": "luminance_k", "iso": 100.0}, label="K", until=day("2026-07-01"))
    drawn = [each for each in figure.series if each.line]
    ends = [(day(a).timestamp(), day(b).timestamp()) for a, b in (
        ("2024-05-01", "2025-05-01"), ("2025-05-01", "2026-05-01"), ("2026-05-01", "2026-07-01"),
    )]  # fmt: skip
    assert [each.line for each in drawn] == [
        ((a, value), (b, value)) for (a, b), value in zip(ends, (31.0, 32.0, 33.0), strict=True)
    ]
    assert [[low for _, low, _ in each.swath] for each in drawn] == [
        [v - 0.1] * 2 for v in (31.0, 32.0, 33.0)
    ]
    in_force, revoked = figure.series[-2:]
    assert (in_force.name, revoked.name) == ("in force", "revoked")
    assert [each.place for each in drawn] == [in_force.place, revoked.place, in_force.place]
    (told,) = [mark.told for each in drawn for mark in each.marks if mark.name == "version 2"]
    assert told == ("32.000 ± 0.050", "2025-05-01 to 2026-05-01", "revoked 2026-06-01: the lamp drifted")
    assert figure.y.label == "K"
    # another coefficient is not mixed with it
    assert (
        build_values(lives, {"name": "luminance_k", "iso": 800.0}, label="K", until=day("2026-07-01")).series
        == ()
    )


def test_lives_have_a_mark_for_each_publication_and_revocation(lives):
    figure = build_lives(lives, until=day("2026-07-01"))
    assert figure.y.ticks == ((0.0, "v1"), (-1.0, "v2"), (-2.0, "v3"))
    assert [(cell.y, cell.share > 0.0, cell.told) for cell in figure.cells] == [
        ((-0.3, 0.3), True, "version 1: in force 2024-05-01 to 2025-05-01"),
        ((-1.3, -0.7), False, "version 2: was in force 2025-05-01 to 2026-05-01"),
        ((-2.3, -1.7), True, "version 3: in force 2026-05-01 to open"),
    ]
    published, revoked = figure.series
    assert [(mark.x, mark.y) for mark in published.marks] == [
        (day(at).timestamp(), -float(n)) for n, at in enumerate(("2024-05-02", "2025-05-02", "2026-05-02"))
    ]
    (mark,) = revoked.marks
    assert (mark.x, mark.y, mark.name) == (
        day("2026-06-01").timestamp(),
        -1.0,
        "version 2 revoked 2026-06-01",
    )
    assert mark.told == ("the lamp drifted",)
