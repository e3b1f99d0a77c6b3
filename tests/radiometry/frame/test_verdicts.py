"""What can be said of a frame before its statistics are looked at."""

from dataclasses import replace

import pytest

from radiometry.findings import Reason, shared
from radiometry.frame.roi import Polygon
from radiometry.frame.verdicts import conclude, find_usual_format, inspect_frame, inspect_frames
from tests.radiometry.evidence import FORMAT, LIGHTS, taken

FRAME = taken(LIGHTS[0])


def inspect(**changes):
    return [(reason.code, reason.outcome) for reason in inspect_frame(replace(FRAME, **changes))]


def formats(*frames):
    """The outcome of format_differs for each frame, "" where there is none."""
    named = [replace(frame, frame=str(number)) for number, frame in enumerate(frames)]
    found = inspect_frames(named)
    return [
        next((r.outcome for r in found[frame.frame] if r.code is shared.FORMAT_DIFFERS), "")
        for frame in named
    ]


def test_another_lens_is_named_unless_it_was_covered():
    lenses = ["15mm L1", "15mm L1", "25mm L2", "", "25mm L2"]
    named = [
        replace(FRAME, frame=str(n), lens=lens, role="dark" if n == 4 else "light")
        for n, lens in enumerate(lenses)
    ]
    found = inspect_frames(named)
    assert {name: [r.code for r in each] for name, each in found.items() if each} == {
        "2": [shared.LENS_DIFFERS]
    }
    assert "The file names the lens 25mm L2, most others name 15mm L1" in found["2"][0].detail


def reason(outcome, code=shared.UNEVEN):
    return Reason(code=code, outcome=outcome, detail="")


def test_nothing_to_say_is_a_pass():
    assert inspect() == []
    assert conclude([]).outcome == "pass"


@pytest.mark.parametrize(
    ("outcomes", "verdict"),
    [
        (["warn"], "warn"),
        (["warn", "pending"], "pending"),
        (["pending", "fail", "warn"], "fail"),
        (["warn", "warn"], "warn"),
    ],
)
def test_the_gravest_reason_decides_and_stands_first(outcomes, verdict):
    found = conclude([reason(outcome) for outcome in outcomes])
    assert found.outcome == verdict
    assert found.reasons[0].outcome == verdict
    assert sorted(r.outcome for r in found.reasons) == sorted(outcomes)


def test_equals_keep_their_order():
    first, second = reason("warn", shared.UNEVEN), reason("warn", shared.RENDERED)
    assert conclude([first, second]).reasons == (first, second)


@pytest.mark.parametrize(
    ("changes", "found"),
    [
        ({"state": "received", "format": None}, [("not_read", "pending")]),
        ({"state": "read"}, [("not_extracted", "pending")]),
        ({"state": "read", "region": None}, [("no_region", "pending")]),
        ({"state": "read", "region": None, "needs_region": False}, []),
        ({"state": "read", "flags": ("roi_empty",)}, [("roi_unfit", "fail")]),
        ({"roles": frozenset({"flat", "dark"})}, [("role_unused", "warn")]),
        ({"roles": frozenset({"light", "dark"})}, []),
        ({"roles": frozenset({"flat", "dark"}), "role": "field"}, []),
        ({"flags": (shared.EXPOSURE_NOT_MANUAL,)}, [("exposure_not_manual", "warn")]),
        ({"flags": (shared.RENDERED,)}, [("rendered", "warn")]),
        ({"flags": (shared.SERIAL_UNKNOWN,)}, []),
    ],
)
def test_a_frame_by_itself(changes, found):
    assert inspect(**changes) == found


def test_a_refused_frame_fails_with_the_sentence_of_its_refusal():
    frame = replace(FRAME, state="refused", refusal="The file ends too early.", format=None)
    (found,) = inspect_frame(frame)
    assert (found.code, found.outcome, found.detail) == ("refused", "fail", "The file ends too early.")


@pytest.mark.parametrize(
    ("points", "sentence"),
    [
        ([(10, 10), (640.5, 10), (10, 50)], "its point (640.5, 10) is outside the 640 x 480 pixels"),
        ([(10.1, 10.1), (10.3, 10.1), (10.2, 10.4)], "holds no pixel centre"),
    ],
)
def test_a_region_that_does_not_fit_the_frame(points, sentence):
    frame = replace(FRAME, state="read", region=Polygon.from_points(points))
    (found,) = inspect_frame(frame)
    assert (found.code, found.outcome) == ("roi_unfit", "fail")
    assert sentence in found.detail


def test_a_region_up_to_the_border_fits():
    border = Polygon.from_points([(0, 0), (640, 0), (640, 480), (0, 480)])
    assert inspect(state="read", region=border) == [("not_extracted", "pending")]


def test_the_usual_format_is_that_of_most_frames():
    other = replace(FRAME, format=(480, 640, "RGGB"))
    unread = replace(FRAME, format=None)
    assert find_usual_format([other, FRAME, FRAME]) == FORMAT
    assert find_usual_format([FRAME, other, other]) == (480, 640, "RGGB")
    assert find_usual_format([FRAME, other]) == find_usual_format([other, FRAME])
    assert find_usual_format([unread]) is None
    assert find_usual_format([replace(other, refusal="no"), unread]) is None


@pytest.mark.parametrize("form", [(480, 640, "RGGB"), (640, 480, "GRBG"), (640, 478, "RGGB")])
def test_another_format_in_the_same_region_fails(form):
    other = replace(FRAME, format=form)
    assert formats(FRAME, other, FRAME) == ["", "fail", ""]
    unread, refused = (replace(other, format=None), replace(other, state="refused"))
    assert formats(FRAME, unread, FRAME, refused) == ["", "", "", ""]


def test_another_format_with_a_region_of_its_own_is_looked_at():
    """Somebody said where the surface lies in it; another sensor mode would still have another K."""
    region = Polygon.from_points([(1, 1), (9, 1), (9, 9)])
    other = replace(FRAME, format=(5280, 3956, "RGGB"), region=region)
    assert formats(FRAME, other, FRAME) == ["", "warn", ""]
    assert formats(other, FRAME, other) == ["", "warn", ""]
    assert formats(FRAME, other, replace(other, format=(5280, 3000, "RGGB")), other, FRAME, FRAME) == [
        *("", "warn", "fail"),
        *("warn", "", ""),
    ]


def test_another_image_size_stands_before_the_region_that_does_not_fit_it():
    small = replace(FRAME, frame="small", state="read", format=(2, 2, "RGGB"))
    others = [replace(FRAME, frame=name) for name in ("a", "b")]
    found = conclude(inspect_frames([small, *others])["small"])
    assert [each.code for each in found.reasons[:2]] == [shared.FORMAT_DIFFERS, shared.ROI_UNFIT]
    assert "2 x 2" in found.reasons[0].detail
