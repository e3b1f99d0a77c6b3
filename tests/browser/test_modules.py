"""Modules of the pages by themselves: what they make of data, without a service's answer."""

import cv2
import numpy as np
import pytest

LAY_OUT = """async ([base, name, frames, rest]) => {
    const { layOut } = await import(`${base}/campaign/matrix.js`);
    const { methodOf } = await import(`${base}/methods.js`);
    const { unfolded = [], ...more } = rest;
    const given = { frames, ...more, unfolded: new Set(unfolded) };
    const { columns, lines, order } = layOut({ method: methodOf(name), ...given });
    const said = (cell) => cell?.frame?.filename ?? cell?.pile?.more ?? (cell?.gap ? "gap" : null);
    return {
        columns: columns.map(({ heads }) => heads.join(" ")),
        lines: lines.map(({ row, cells }) => [row.label, cells.map(said)]),
        order: order.map((frame) => frame.filename),
    };
}"""
FORMAT = """async ([base, name, values]) => {
    const found = await import(`${base}/format.js`);
    return values.map((value) => found[name](value));
}"""
HOLDS_FOR = """async ([base, row]) => (await import(`${base}/methods.js`)).holdsFor(row)"""
TIME = """async ([base, at]) => (await import(`${base}/format.js`)).time(at).textContent"""
IN_ORDER = """async ([base, names]) => (await import(`${base}/format.js`)).inOrder(names, (name) => name)"""
ISO_VALUES = """async ([base, cases]) => {
    const { isoValues } = await import(`${base}/card/view.js`);
    return cases.map((isos) => isoValues(isos.map((iso) => ({ header: { iso } }))));
}"""
REFUSED = """async ([base, frames]) => {
    const { refusedCauses } = await import(`${base}/campaign/moves.js`);
    return refusedCauses({ frames }).map(({ mark, title, where }) => [mark, title, where]);
}"""
CLOCKS = """async ([base, cases]) => {
    const { assumed } = await import(`${base}/timeline.js`);
    return cases.map(([campaign, ...frames]) => assumed(frames, campaign));
}"""
READ_GRID = """async ([base, points, places]) => {
    const { gridReader } = await import(`${base}/road/map.js`);
    return places.map((place) => gridReader(points, { across_m: 1 })(...place) ?? null);
}"""
PLACED = """async ([base, placement, places]) => {
    const { toImage, toRoad } = (await import(`${base}/measurement/surface.js`)).placed(placement);
    return places.map((place) => [toImage(place), toRoad(toImage(place))]);
}"""
_AXES = ("scene", "iso", "f_number", "exposure_time_s", "band", "capture_id", "taken_at")


@pytest.fixture(scope="module")
def run(browser, service):
    """Run a script with the address of the modules and its arguments."""
    with browser.new_context(base_url=service.url) as context:
        page = context.new_page()
        page.goto("/sign-in")
        base = page.locator("link[rel=stylesheet]").first.get_attribute("href").rpartition("/")[0]
        yield lambda script, *arguments: page.evaluate(script, [base, *arguments])


def frame(role, name, **values):
    return dict.fromkeys(_AXES) | {"id": name, "role": role, "filename": name, "withdrawn": False} | values


def test_scenes_stand_in_natural_order_and_gaps_in_their_cells(run):
    frames = [
        frame("light", f"{scene}-{f_number}", scene=scene, iso=100, f_number=f_number)
        for scene in ("level-10", "level-2")
        for f_number in (11, 5.6)
    ]
    gaps = [{"role": "light", "at": {"scene": "level-2", "iso": 100, "f_number": 8}, "text": ""}]
    found = run(LAY_OUT, "luminance", frames, {"gaps": gaps, "readings": [{"scene": "level-1"}]})
    assert found["columns"] == ["ISO 100 f/5.6", "ISO 100 f/8", "ISO 100 f/11"]
    assert found["lines"] == [
        ["level-1", [None, None, None]],
        ["level-2", ["level-2-5.6", "gap", "level-2-11"]],
        ["level-10", ["level-10-5.6", None, "level-10-11"]],
    ]
    assert found["order"][0] == "level-2-5.6"


def test_a_method_lays_its_frames_out_along_its_own_axes(run):
    visits = [
        frame("panel", f"{band}-{n}", band=band, capture_id=n, taken_at=f"2026-05-01T1{n}:00:00")
        for n in "12"
        for band in ("red_edge", "blue")
    ]
    found = run(LAY_OUT, "reflectance", visits, {})
    assert found["columns"] == ["blue", "red edge"]
    assert [line for line in found["lines"] if any(line[1])] == [
        ["2026-05-01 11:00:00", ["blue-1", "red_edge-1"]],
        ["2026-05-01 12:00:00", ["blue-2", "red_edge-2"]],
    ]
    flats = [frame("flat", f"{f}-{n}", f_number=f) for f in (11, 5.6) for n in (10, 9)]
    found = run(LAY_OUT, "vignetting", flats, {})
    assert found["columns"] == [""] * 6
    assert [(label, cells[:3]) for label, cells in found["lines"]] == [
        ("f/5.6", ["5.6-9", "5.6-10", None]),
        ("f/11", ["11-9", "11-10", None]),
    ]
    pairs = [frame("flat", f"{t}-{n}", exposure_time_s=t, iso=100) for t in (0.5, 0.001) for n in (1, 2)]
    found = run(LAY_OUT, "noise", pairs, {})
    assert (found["columns"], [label for label, _ in found["lines"]]) == (
        ["ISO 100"],
        ["1/1000 s", "1/1000 s", "0.5 s", "0.5 s"],
    )
    views = [frame("chart", f"view-{n}") for n in range(12, 0, -1)]
    lines = run(LAY_OUT, "geometry", views, {})["lines"]
    assert [cells for _, cells in lines] == [
        [f"view-{n}" for n in row] for row in (range(1, 7), range(7, 13))
    ]


def test_a_campaign_may_be_of_one_scene_or_of_one_frame_a_scene(run):
    one = [frame("light", f"DJI_{n}", scene="a", iso=100, f_number=4 + n % 40) for n in range(400)]
    found = run(LAY_OUT, "luminance", one, {})
    # ten repeats in each cell: three are shown, and the number of the others
    assert (len(found["columns"]), len(found["lines"]), len(found["order"])) == (40, 4, 400)
    assert {more for _, cells in found["lines"][3:] for more in cells} == {7}
    opened = run(LAY_OUT, "luminance", one, {"unfolded": ['["role","light","a"]2']})["lines"]
    assert [line[2] for _, line in opened] == [f"DJI_{n}" for n in range(2, 400, 40)] + [0]
    many = [frame("light", f"DJI_{n}", scene=f"{'x' * 290} {n}", iso=100, f_number=4) for n in range(400)]
    found = run(LAY_OUT, "luminance", many, {"perCard": 12})
    assert (len(found["lines"]), found["order"]) == (400, [f"DJI_{n}" for n in range(400)])
    unread = [frame("light", "new", scene="a")]
    assert run(LAY_OUT, "luminance", unread, {})["lines"][0][0] == "No exposure yet"


def test_times_numbers_and_names_are_written_for_people(run):
    flags = ["noise_high", "dark_exposure_differs", "quarantined"]
    said = ["noise high", "dark frames at another exposure", "stopped after 3 attempts"]
    assert run(FORMAT, "stateWords", flags) == said
    seconds = [0.001, 1 / 8000, 0.0125, 1 / 3, 0.5, 2, 30, None]
    written = ["1/1000 s", "1/8000 s", "1/80 s", "0.333 s", "0.5 s", "2 s", "30 s", "\u2013"]
    assert run(FORMAT, "exposureTime", seconds) == written
    assert run(FORMAT, "number", [1234.5, 12345, -0.25, 0.00001234]) == [
        "1235",
        "12\u202f350",
        "\u22120.25",
        "1.234 \u00d7 10⁻⁵",
    ]
    assert run("async ([base]) => (await import(`${base}/format.js`)).fixed(-0.004, 2)") == "0.00"
    shares = [3.9e-7, 0.0, -0.0, 0.00044, 0.007, 0.0073, 0.02, 0.0996, -0.019, 1.0]
    said = ["< 0.001 %", "0 %", "0 %", "0.044 %", "0.70 %", "0.73 %", "2.0 %", "10 %", "\u22121.9 %", "100 %"]
    assert run(FORMAT, "percent", shares) == said
    assert run(HOLDS_FOR, {"iso": 12800.0, "f_number": 2.8}) == "ISO 12800, f/2.8"
    assert run(FORMAT, "words", ["noise_high"]) == ["noise high"]
    assert run(TIME, "2026-05-01T21:29:00+02:00") == "2026-05-01 19:29 UTC"
    assert run(TIME, "2026-05-01T21:29:00") == "2026-05-01 21:29"  # as the clock showed it, wherever it was
    assert run(IN_ORDER, ["level-10", "level-2", "DJI_10", "DJI_9"]) == [
        "DJI_9",
        "DJI_10",
        "level-2",
        "level-10",
    ]


def test_card_counts_no_iso_values_where_files_state_none(run):
    assert run(ISO_VALUES, [[None, None], [100, None, 100], [100, 200]]) == [
        "",
        "1 ISO value",
        "2 ISO values",
    ]


def test_frames_of_another_image_size_have_a_line_with_both_sizes(run):
    def unlike(name, detail, outcome="fail"):
        return {"filename": name, "outcome": outcome, "code": "format_differs", "detail": detail}

    small, tiny = (
        "This frame is 60 x 96 pixels, RGGB, others 64 x 96. Take it again.",
        "30 x 48, others 64 x 96.",
    )
    frames = [
        unlike("a.DNG", small),
        unlike("b.DNG", tiny),
        unlike("c.DNG", small),
        unlike("d.DNG", small, "warn"),
        {"filename": "e.DNG", "outcome": "fail", "code": "clipped", "detail": "Clipped."},
        {
            "filename": "f.DNG",
            "outcome": "fail",
            "code": "refused",
            "refusal_code": "damaged",
            "detail": "Cut.",
        },
    ]
    assert [[mark, title, where.replace("\u00d7", "x")] for mark, title, where in run(REFUSED, frames)] == [
        ["bad", "2 frames of another image size", f"{small} (a.DNG, c.DNG)"],
        ["bad", "1 frame of another image size", f"{tiny} (b.DNG)"],
        ["bad", "1 frame refused", "Cut. (f.DNG)"],
    ]


def test_what_is_assumed_of_clocks_without_an_offset_is_told(run):
    berlin, known, unknown = (
        {"time_zone": zone, "instant": at}
        for zone, at in (
            ("Europe/Berlin", "2026-05-01T18:00:00Z"),
            (None, "2026-05-01T18:00:00Z"),
            (None, None),
        )
    )
    cases = [
        [{"time_zone": "Europe/Berlin"}, berlin, berlin],
        [{}, berlin, known],
        [{}, unknown],
        [{}, known],
    ]
    campaign, organisation, silent, nothing = run(CLOCKS, cases)
    assert campaign.endswith("is read as Europe/Berlin, as the campaign states; drawn in UTC.")
    assert organisation.endswith("is read as Europe/Berlin, as the organisation states; drawn in UTC.")
    assert "drawn as UTC" in silent
    assert nothing == ""


def test_a_road_is_read_between_the_points_of_its_grid(run):
    values = {
        (0, 0): (10, 0.02, 0.5),
        (2, 0): (40, 0.04, 1.5),
        (0, 1): (10, 0.02, 0.5),
        (2, 1): (40, 0.04, 1.5),
    }
    names = ("illuminance_lx", "u_rel", "luminance_cd_m2")
    points = [
        {"part": "1", "x_m": x, "y_m": y} | dict(zip(names, each, strict=True))
        for (x, y), each in values.items()
    ]
    middle, point, edge, beside = run(READ_GRID, points, [[1, 0.5], [2, 0], [2.9, 0.5], [3.1, 0.5]])
    assert middle == pytest.approx({"lux": 20, "u_rel": 0.03, "luminance": 1})  # sqrt(10 * 40)
    assert point == edge == pytest.approx({"lux": 40, "u_rel": 0.04, "luminance": 1.5})
    assert beside is None


def test_a_place_on_the_road_lies_in_the_picture_as_opencv_has_it(run):
    h = np.array([[0.05, 0.003, -0.6], [0.002, 0.06, -0.2], [0.0005, 0.001, 1.0]])
    matrix, bend = (
        np.array([[900.0, 0, 799.5], [0, 910.0, 599.5], [0, 0, 1]]),
        np.array([-0.2, 0.05, 1e-3, -2e-3, -0.01]),
    )
    places = [[0.0, 0.0], [10.0, 3.0], [22.0, 7.0]]
    rays = np.column_stack([places, np.ones(3)]) @ h.T
    seen, _ = cv2.projectPoints(rays / rays[:, 2:], np.zeros(3), np.zeros(3), matrix, bend)
    stated = {"h": h.tolist(), "matrix": matrix.tolist(), "distortion": bend.tolist()}
    for place, pixel, (there, back) in zip(
        places, seen.reshape(-1, 2) + 0.5, run(PLACED, stated, places), strict=True
    ):
        assert there == pytest.approx(pixel, abs=1e-6)
        assert back == pytest.approx(place, abs=1e-4)
