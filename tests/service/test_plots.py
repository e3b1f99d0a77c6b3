"""A result drawn: what is computed is where it belongs on the sheet, for every method."""

import itertools
import re
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from radiometry import methods
from radiometry.frame.packing import pack
from radiometry.methods import get_method
from radiometry.road.drawing import Canvas
from service.pages.cameras import View, draw_figure
from store.codec import drop_absent, encode

GRAPH = "{http://www.w3.org/2000/svg}"


def quantity(value, u=0.1, unit="1"):
    return {"value": value, "standard_uncertainty": u, "unit": unit}


def reflectance():
    def coefficient(band, nm, k):
        return {
            "band": band,
            "wavelength_nm": nm,
            "reflectance_k": k,
            "reflectance_k_unit": "1/s",
            "expanded_uncertainty": 0.1 * k,
            "coverage_factor": 2.0,
            "knots": [
                {"at_s": 100.0, "reflectance_k": 0.9 * k, "u_rel": 0.01},
                {"at_s": 700.0, "reflectance_k": 1.1 * k, "u_rel": 0.01},
            ],
        }

    bands = [coefficient("green", 550.0, 10.0), coefficient("nir", 790.0, 40.0)]
    points = [
        {"frame": f"{c['band']}-{at}", "band": c["band"], "used": used, "visit": 1, "at_s": at}
        | {"reflectance_k": c["reflectance_k"] * share if used else None}
        for c in bands
        for at, share, used in ((100.0, 0.9, True), (700.0, 1.1, True), (300.0, 0.0, False))
    ]
    return {"band_fits": [{"coefficient": c} for c in bands], "points": points}


def vignetting():
    residuals = np.zeros((4, 6))
    residuals[0, 0], residuals[3, 5], residuals[1, 1] = -0.01, 0.01, np.nan
    fits = [
        {
            "coefficient": {
                "f_number": f_number,
                "channel": channel,
                "height_px": 40,
                "width_px": 60,
                "centre_row_px": 20.0,
                "centre_col_px": 30.0,
                "radius_px": 36.06,
                "k1": k1,
                "k2": 0.0,
                "k3": 0.0,
                "covariance": np.diag([1e-4] * 5).tolist(),
                "corner_falloff": -k1,
                "corner_falloff_standard_uncertainty": 0.01,
            },
            "residuals": encode(pack(residuals, dtype="<f4")),
        }
        for f_number, k1 in ((2.0, -0.4), (4.0, -0.1))
        for channel in ("R", "G1")
    ]
    return {"channel_fits": fits, "thresholds": [{"falloff": 0.1}], "points": []}


def sharpness():
    positions = [
        {
            "kind": "slanted_edge",
            "position": name,
            "channel": "G",
            "f_number": None,
            "radius_rel": radius,
            "row_px": 100.0 + 90.0 * radius,
            "col_px": 150.0,
            "coefficients": [{"name": "mtf50_cycles_per_pixel", "quantity": quantity(mtf50, 0.01)}],
            "curves": [
                {
                    "direction_deg": None,
                    "frequency": [0.0, mtf50, 1.0],
                    "response": [1.0, 0.5, 0.0],
                    "response_u": [0.0, 0.02, 0.02],
                }
            ],
        }
        for name, radius, mtf50 in (("centre", 0.0, 0.3), ("corner", 0.9, 0.2))
    ]
    return {"positions": positions, "points": []}


def geometry():
    curve = [
        {
            "radius_px": r,
            "distortion_px": -1e-4 * r**2,
            "standard_uncertainty_px": 0.1,
            "extrapolated": r > 200,
        }
        for r in (0.0, 100.0, 200.0, 300.0)
    ]
    points = [
        {"frame": "a", "used": True, "left_out": "", "rms_px": 0.2},
        {"frame": "b", "used": False, "left_out": "worse", "rms_px": 3.0},
        {"frame": "c", "used": False, "left_out": "no board", "rms_px": None},
    ]
    return {
        "curve": curve,
        "camera": {"width_px": 640, "height_px": 480},
        "coverage": {"counts": [[0, 7], [3, 0]], "share": 0.5},
        "rms_px": 0.2,
        "points": points,
    }


def noise():
    levels = [
        {
            "exposure_time_s": time,
            "signal_dn": signal,
            "light_dn": signal,
            "excess_dn2": 0.5 * signal,
            "snr": (signal / 0.5) ** 0.5,
            "deviation_rel": deviation,
            "left_out": left_out,
        }
        for time, signal, deviation, left_out in (
            (0.01, 100.0, 0.01, ""),
            (0.1, 1000.0, -0.01, ""),
            (1.0, 10000.0, None, "saturated"),
        )
    ]
    fit = {
        "iso": 100.0,
        "channel": "G1",
        "transfer": {"system_gain_dn_per_e": quantity(0.5)},
        "levels": levels,
    }
    return {"channel_fits": [fit, {**fit, "channel": "R", "transfer": None}], "points": []}


def luminance():
    def point(iso, rhs, residual):
        return {
            "iso": iso,
            "rhs": rhs,
            "adjusted_signal_dn": 2.0 * rhs,
            "residual_rel": residual,
            "used": residual is not None,
            "left_out": "" if residual is not None else "saturated",
            "frame": f"{rhs:g}",
            "frame_id": f"frm_{rhs:g}",
            "scene": "level-1",
            "exposure_time_s": 0.01,
            "f_number": 4.0,
            "luminance_cd_m2": rhs,
        }

    coefficient = {"iso": 100.0, "model": "proportional", "parameters": [2.0], "luminance_k": 2.0}
    coefficient |= {"expanded_uncertainty": 0.1, "luminance_k_unit": "DN*m2/(cd*s)", "apertures": None}
    points = [
        point(100.0, rhs, residual)
        for rhs, residual in ((20.0, 0.01), (50.0, -0.02), (300.0, 0.0), (8e3, None))
    ]
    points.append(points[-1] | {"luminance_cd_m2": None, "rhs": None, "scene": "without a reading"})
    return {"iso_fits": [{"coefficient": coefficient}], "points": points, "tolerance_rel": 0.04}


RESULTS = {
    "luminance": luminance,
    "reflectance": reflectance,
    "vignetting": vignetting,
    "sharpness": sharpness,
    "geometry": geometry,
    "noise": noise,
}


def draw(method):
    return ET.fromstring(get_method(method).draw(RESULTS[method]()))


def lines(picture, css):
    found = [
        each.get("points").split() for each in picture.iter(f"{GRAPH}polyline") if each.get("class") == css
    ]
    return [[tuple(map(float, point.split(","))) for point in points] for points in found]


def texts(picture):
    return [each.text for each in picture.iter(f"{GRAPH}text")]


def told(picture):
    """Of each point: its tooltip, and of the last with it place and class."""
    return {
        each.find(f"{GRAPH}title").text: (*place_of(each), each.get("class"))
        for each in picture.iter(f"{GRAPH}path")
        if each.find(f"{GRAPH}title") is not None
    }


def place_of(point):
    return tuple(map(float, re.match(r"translate\(([\d.]+) ([\d.]+)\)", point.get("transform")).groups()))


def test_every_method_is_drawn():
    assert set(RESULTS) == {spec.name for spec in methods.METHODS}


def axes_of(picture):
    """Of each panel's axes: the label, and each tick's place [px] with the text beside it, if it has one."""
    found = []
    for each, after in itertools.pairwise([*picture, None]):
        if each.get("class") == "box":
            found += [("", []), ("", [])]
            labels = iter((2, 1))
            continue
        if each.get("class") == "tick" and after.tag == f"{GRAPH}text":
            x, y, across = re.fullmatch(r"M([\d.]+) ([\d.]+)([HV]).*", each.get("d")).groups()
            text = after.text.removeprefix("f/").replace("\N{THIN SPACE}", "")
            found[-2 if across == "V" else -1][1].append((float(x if across == "V" else y), text))
        elif each.tag == f"{GRAPH}text" and each.get("class") == "mid" and not found[-2][1]:
            at = next(labels, None)
            if at:
                found[-at] = (each.text, found[-at][1])
    return found


def pictures():
    return {
        **{method: ET.fromstring(get_method(method).draw(result())) for method, result in RESULTS.items()},
        "noise of one level": ET.fromstring(draw_one_level()),
        "signal": plotted("signal"),
        "signal in logarithms": plotted("signal", part=1),
        "residuals": plotted("residuals-signal"),
        "falloff": plotted("falloff", "vignetting"),
        "transfer": plotted("transfer", "noise"),
        "distortion": plotted("distortion", "geometry"),
        "response": plotted("response", "sharpness"),
        "bands": plotted("bands", "reflectance"),
    }


def plotted(name, method="luminance", *, part=0, **view):
    (plot,) = (each for each in get_method(method).plots if each.name == name)
    figure = list(plot.build(RESULTS[method](), list))[part]
    return ET.fromstring(draw_figure(figure, plot.title, view=View(**view)))


def draw_one_level():
    result = noise()
    one = [{**fit, "levels": fit["levels"][:1]} for fit in result["channel_fits"]]
    return get_method("noise").draw(result | {"channel_fits": one})


def test_every_tick_reads_the_value_at_its_place():
    """A logarithmic axis has three texts or more, each as far along as its logarithm, none over another."""
    logarithmic = 0
    for name, picture in pictures().items():
        for x_axis, (label, ticks) in zip(itertools.cycle([True, False]), axes_of(picture), strict=False):
            places, values = (np.array(each, float) for each in zip(*ticks, strict=True))
            if label == "f-number":
                values = np.log(values)
            if "logarithmic" in label:
                logarithmic += 1
                assert len(ticks) >= 3, (name, label)
                # beside each other texts need their width, above each other their height
                across = [7 * len(text) for _, text in ticks] if x_axis else [12] * len(ticks)
                room = np.abs(np.diff(places)) - (np.array(across[1:]) + across[:-1]) / 2
                assert all(room > 0), (name, label, ticks)
                values = np.log(values)
            slope, start = np.polyfit(values, places, 1)
            assert places == pytest.approx(start + slope * values, abs=0.2), (name, label, ticks)
    # three of luminance, four of noise twice, of pages' charts luminance's three, noise's two
    assert logarithmic == 3 + 4 + 4 + 3 + 2


@pytest.mark.parametrize("method", RESULTS)
def test_what_does_not_exist_may_be_null_or_left_out(method):
    result = RESULTS[method]()
    spec = get_method(method)
    assert spec.draw(drop_absent(result)) == spec.draw(result)
    for plot in spec.plots:
        assert list(plot.build(drop_absent(result), list)) == list(plot.build(result, list)), plot.name


@pytest.mark.parametrize("method", RESULTS)
def test_nothing_is_drawn_beside_the_sheet(method):
    picture = draw(method)
    width, height = float(picture.get("width")), float(picture.get("height"))
    for each in picture.iter():
        for x, y in re.findall(r"(-?[\d.]+),(-?[\d.]+)", each.get("points") or ""):
            assert 0 <= float(x) <= width
            assert 0 <= float(y) <= height


def test_reflectance_shows_k_by_wavelength():
    dots = told(draw("reflectance"))
    (x_green, y_green, _), (x_nir, y_nir, _) = (
        dots[f"band {band}, {k} 1/s (95 %)"] for band, k in (("green", "10.0 ± 1.0"), ("nir", "40.0 ± 4.0"))
    )
    # x from 520 to 820 with 6 % of air, over 290 px
    assert x_nir - x_green == pytest.approx(240 * 290 / (300 * 1.12), abs=0.2)
    # y from 0 to 44 with 6 % of air, over 204 px
    assert y_green - y_nir == pytest.approx(30 * 204 / (44 * 1.12), abs=0.2)


def read_axes(picture, panel):
    """Return functions from a pixel to the value along both axes of a panel."""
    ticks = (axes_of(picture)[2 * panel + axis][1] for axis in (0, 1))
    fits = [np.polyfit(*zip(*[(at, float(text)) for at, text in each], strict=True), 1) for each in ticks]
    return [np.poly1d(fit) for fit in fits]


def test_reflectance_shows_k_in_time_between_its_visits_and_the_flight():
    flight = {"flight": [f"1970-01-01T00:{minute:02}:00+00:00" for minute in (3, 5, 9, 20)]}
    picture = ET.fromstring(get_method("reflectance").draw(reflectance() | flight))
    x, y = read_axes(picture, 1)
    dots = told(picture)
    first, last = dots["green-100.0"], dots["green-700.0"]
    assert [x(first[0]), x(last[0])] == pytest.approx([0.0, 10.0], abs=0.05)
    assert [y(first[1]), y(last[1])] == pytest.approx([-10.0, 10.0], abs=0.1)
    assert "green-300.0" not in dots
    band = next(each for each in picture.iter(f"{GRAPH}polygon"))
    points = [tuple(map(float, point.split(","))) for point in band.get("points").split()]
    lower, upper = points[: len(points) // 2], points[len(points) // 2 :][::-1]
    widths = {round(x(a), 1): y(b) - y(c) for (a, b), (_, c) in zip(upper, lower, strict=True)}
    # two times 1 % either way at a visit; more between and after the visits, where nothing was measured
    assert widths[0.0] == pytest.approx(4.0, abs=0.1)
    assert widths[10.0] == pytest.approx(4.0, abs=0.1)
    assert max(widths) > 18.0
    assert widths[max(widths)] > 1.3 * widths[10.0]
    marks = [mark for mark in lines(picture, "box") if len(mark) == 2]
    assert [x(at) for (at, _), _ in marks[:4]] == pytest.approx([4 / 3, 10 / 3, 22 / 3, 55 / 3], abs=0.05)
    assert texts(picture).count("frames of the flight") == 2


def test_vignetting_shows_the_curve_of_green_and_the_map_of_what_is_left():
    picture = draw("vignetting")
    for css, end in (("line s0", 0.6), ("line s1", 0.9)):
        curve = lines(picture, css)[1]
        # share of light from 0.6 to 1 with 6 % of air, over 204 px
        assert curve[-1][1] - curve[0][1] == pytest.approx((1 - end) * 204 / (0.4 * 1.12), abs=0.2)
    assert sum("full shade: ±1 %" in text for text in texts(picture)) == 2
    rects = [each for each in picture.iter(f"{GRAPH}rect") if each.get("class") != "box"]
    assert len(rects) == 2 * 24
    full = {each.get("class"): each for each in rects[:24] if each.get("fill-opacity") == "1.000"}
    darkest, brightest = full["cell s1"], full["cell s0"]
    # row 0 is at the top, column 0 at the left
    assert float(darkest.get("y")) < float(brightest.get("y"))
    assert float(darkest.get("x")) < float(brightest.get("x"))
    assert [each.get("class") for each in rects[:24]].count("cell unknown") == 1


def test_geometry_shows_barrel_below_zero_and_rows_from_the_top():
    picture = draw("geometry")
    (seen,), (beyond,) = lines(picture, "line s0"), lines(picture, "line s1")
    assert seen[-1] == beyond[0]
    assert beyond[-1][1] > seen[-1][1] > seen[0][1]
    counts = {each.text: each for each in picture.iter(f"{GRAPH}text") if each.get("class") == "mid note"}
    assert float(counts["7"].get("y")) < float(counts["3"].get("y"))
    assert float(counts["7"].get("x")) > float(counts["3"].get("x"))
    dots = {name.split(",")[0]: (name, css) for name, (*_, css) in told(picture).items()}
    assert dots["a"][1] == "point s0"
    assert dots["b"] == ("b, rms of its corners 3 px, left out: worse", "point out s0")
    assert len(dots) == 2


def test_the_surface_is_dark_in_the_corner_and_downward_as_the_frame_is():
    picture = plotted("surface", "vignetting")
    cells = [each for each in picture.iter(f"{GRAPH}rect") if (each.get("class") or "").startswith("cell")]
    # 1 - 0.4 (18.75^2 + 28.75^2) / 36.06^2: the middle of the first cell of 24 by 16, each of 2.5 px
    assert cells[0].get("data-told") == "row 1, column 1: 63.8 % of the light"
    assert float(cells[0].get("y")) < float(cells[-1].get("y"))
    shades = [float(each.get("fill-opacity")) for each in cells]
    assert max(shades) == shades[0] > 0.9
    assert min(shades) < 0.01


def test_texts_on_the_map_of_a_road_lie_over_no_other():
    canvas = Canvas((0.0, 50.0), (0.0, 10.0))
    for x_m in (20.0, 21.5, 40.0):
        canvas.text((x_m, 9.0), "P1 16.4 lx")
    first, second, third = (float(y) for y in re.findall(r'<text x="[\d.]+" y="([\d.]+)"', canvas.finish()))
    assert abs(first - second) > 12
    assert third == first
    upright = Canvas((0.0, 50.0), (0.0, 10.0), is_upright=True)
    for y_m in (0.0, 10.0):
        upright.text((25.0, y_m), "S = 35 m")
    left, right = (float(x) for x in re.findall(r'<text x="([\d.]+)"', upright.finish()))
    assert left > 28.8
    assert right < upright.width - 28.8
