"""A frame after its upload: read, refused, corrected, measured in one region and then in another."""

import struct

import numpy as np
import pytest
import tifffile

from tests.support.campaigns import calibrate, upload_campaign
from tests.support.frames import write_raw

pytestmark = pytest.mark.either_database

ROI = [[8, 8], [88, 8], [88, 56], [8, 56]]
SMALL = [[10, 10], [20, 10], [20, 20]]


def set_roi(house, campaign, body, *, status=200):
    answer = house.http.put(f"/v1/campaigns/{campaign['id']}/roi", json=body)
    assert answer.status_code == status, answer.text
    return answer.json()


def get(house, frame):
    return house.get(f"/v1/frames/{frame['id']}")


def patch(house, frame, **changes):
    answer = house.http.patch(f"/v1/frames/{frame['id']}", json=changes)
    assert answer.status_code == 200, answer.text
    return answer.json()


def rows_of(frame, roi):
    return [row for row in frame["statistics"] if row["roi"] == roi["id"]]


def counted(inner, asked):
    def call(*args):
        asked.append(inner.__name__)
        return inner(*args)

    return call


@pytest.fixture
def calls(house, monkeypatch):
    """What the decoder is asked for."""
    asked = []
    for name in ("read_header", "read_window", "inspect"):
        monkeypatch.setattr(house.worker.decoders, name, counted(getattr(house.worker.decoders, name), asked))
    return asked


@pytest.fixture
def bare_tiff(house):
    """A picture that says nothing of its exposure."""
    path = house.folder / "bare.tif"
    tifffile.imwrite(path, np.full((64, 96), 1000, np.uint16), photometric="minisblack")
    return path.read_bytes()


def test_a_frame_says_what_it_is(house):
    campaign = house.campaign()
    roi = set_roi(house, campaign, {"polygon": ROI})
    frame = house.upload(campaign, house.frame_bytes(), role="light", scene="level-1")
    assert frame["state"] == "received"
    house.work()
    frame = get(house, frame)
    assert [row["channel"] for row in rows_of(frame, roi)] == ["B", "G1", "G2", "R", "grey"]
    assert (frame["state"], frame["cfa"]) == ("extracted", "RGGB")
    assert (frame["width_px"], frame["height_px"]) == (96, 64)
    assert (frame["exposure_time_s"], frame["f_number"], frame["iso"]) == (0.01, 4.0, 3200.0)
    assert (frame["black_level_dn"], frame["white_level_dn"]) == (256.0, 4095.0)
    assert frame["camera"]["serial"] == "0K1XE8"
    preview = house.http.get(f"/v1/frames/{frame['id']}/preview.png")
    assert preview.headers["content-type"] == "image/png"
    width, height = struct.unpack(">II", preview.content[16:24])
    assert width / height == frame["width_px"] / frame["height_px"]


def test_a_preview_is_not_there_before_the_frame_is_read(house):
    frame = house.upload(house.campaign(), house.frame_bytes(), role="light")
    problem = house.get(f"/v1/frames/{frame['id']}/preview.png", status=404)
    assert (problem["code"], problem["retryable"]) == ("preview_not_ready", True)


def test_a_correction_reads_the_frame_again(house):
    campaign = house.campaign()
    set_roi(house, campaign, {"polygon": ROI})
    frame = house.upload(campaign, house.frame_bytes(), role="dark", scene="level-9")
    house.work()
    said = patch(house, frame, role="light", scene="level-1")
    assert (said["role"], said["scene"], said["state"]) == ("light", "level-1", "read")
    assert said["job_id"] != frame["job_id"]
    house.work()
    assert get(house, frame)["state"] == "extracted"
    assert patch(house, frame, scene="level-1")["job_id"] == said["job_id"]


def test_samples_above_the_white_level_are_flagged(house):
    samples = np.full((64, 96), 1000, np.uint16)
    campaign, flags = house.campaign(), []
    for highest in (4095, 4096):
        samples[5, 5] = highest
        content = write_raw(house.folder / "white.dng", samples).read_bytes()
        frame = house.upload(campaign, content, role="dark")
        house.work()
        flags.append("samples_above_white" in get(house, frame)["warnings"])
    assert flags == [False, True]


def test_a_missing_exposure_is_typed_in_with_a_second_upload(house, bare_tiff):
    campaign = house.campaign()
    frame = house.upload(campaign, bare_tiff, role="light", scene="a")
    house.work()
    refused = get(house, frame)
    assert (refused["state"], refused["refusal"]["code"]) == ("refused", "exposure_missing")
    assert "typed in (exposure_time_s)" in refused["refusal"]["detail"]
    typed = {"exposure_time_s": 0.02, "f_number": 5.6, "iso": 6400}
    again = house.upload(campaign, bare_tiff, status=200, role="light", scene="a", roi=str(SMALL), **typed)
    assert again["id"] == frame["id"]
    assert again["supplied"] == typed
    house.work()
    accepted = get(house, frame)
    assert (accepted["state"], "refusal" in accepted) == ("extracted", False)
    assert {name: accepted[name] for name in typed} == typed
    assert accepted["exposure"]["iso_origin"] == "supplied"
    assert house.get(f"/v1/jobs/{again['job_id']}")["state"] == "succeeded"


def test_a_missing_exposure_is_typed_in_with_a_correction(house, bare_tiff):
    frame = house.upload(house.campaign(), bare_tiff, role="light", exposure_time_s=0.02)
    house.work()
    assert get(house, frame)["refusal"]["detail"].startswith("The file does not say the")
    patch(house, frame, f_number=5.6, iso=6400)
    house.work()
    assert get(house, frame)["supplied"] == {"exposure_time_s": 0.02, "f_number": 5.6, "iso": 6400}
    assert get(house, frame)["state"] == "read"


def test_a_frame_of_another_camera_is_refused(house):
    frame = house.upload(house.campaign(), house.frame_bytes(serial="OTHER"), role="light")
    house.work()
    refusal = get(house, frame)["refusal"]
    assert refusal["code"] == "wrong_camera"
    assert "'OTHER'" in refusal["detail"]
    assert (
        house.get(f"/v1/campaigns/{house.get('/v1/campaigns')['items'][0]['id']}")["frames"]["refused"] == 1
    )


def test_a_region_comes_as_points_or_as_imagejs_line(house):
    campaign = house.campaign()
    missing = house.get(f"/v1/campaigns/{campaign['id']}/roi", status=404)
    assert missing["detail"] == "This campaign has no region yet: PUT one here."
    points = set_roi(house, campaign, {"polygon": ROI})
    line = set_roi(house, campaign, {"imagej": "makePolygon(8,8,88,8,88,56,8,56);"})
    rectangle = set_roi(house, campaign, {"imagej": "makeRectangle(8, 8, 80, 48)"})
    assert points["id"] == line["id"] == rectangle["id"]
    assert house.get(f"/v1/campaigns/{campaign['id']}/roi") == points
    assert points["polygon"] == ROI


@pytest.mark.parametrize(
    ("body", "code", "words"),
    [
        ({"polygon": [[0, 0], [9, 9], [9, 0], [0, 5]]}, "roi_self_intersecting", "crosses or touches itself"),
        ({"polygon": [[0, 0], [1, 1], [2, 2]]}, "roi_invalid", "encloses no area"),
        ({"polygon": [[0, 0], [1, 1], [0, 0]]}, "roi_invalid", "three different points"),
        ({"imagej": "makeOval(1,2,3,4)"}, "roi_invalid", "paste a line such as makePolygon"),
        ({"imagej": "makePolygon(1,2,3)"}, "roi_invalid", "every x needs its y"),
        ({"imagej": "makePolygon(1,2,nan,4,5,6)"}, "roi_invalid", "finite position"),
        (
            {"polygon": ROI, "imagej": "makeRectangle(1,2,3,4)"},
            "validation_failed",
            "either polygon, imagej or regions",
        ),
        ({}, "validation_failed", "either polygon, imagej or regions"),
        ({"polygon": [[1, 2], [3, 4], [5]]}, "validation_failed", "body.polygon.2"),
        ({"polygon": [[1, 2], [3, 4]]}, "validation_failed", "body.polygon"),
        ({"polygon": [[0, 0], [2e6, 0], [0, 9]]}, "validation_failed", "body.polygon.1.0"),
    ],
)
def test_a_region_that_is_none(house, body, code, words):
    campaign = house.campaign()
    problem = set_roi(house, campaign, body, status=422)
    assert problem["code"] == code
    assert words in problem["detail"]


@pytest.mark.parametrize(
    ("polygon", "code"),
    [
        ([[0, 0], [500, 0], [500, 40]], "roi_outside_frame"),
        ([[1.1, 1.1], [1.3, 1.1], [1.2, 1.3]], "roi_empty"),
    ],
)
def test_a_region_that_does_not_fit_its_frame_is_said_at_the_frame(house, polygon, code):
    campaign = house.campaign()
    set_roi(house, campaign, {"polygon": polygon})
    frame = house.upload(campaign, house.frame_bytes(), role="light")
    house.work()
    job = house.get(f"/v1/jobs/{frame['job_id']}")
    assert (job["state"], job["error"]["code"]) == ("failed", code)
    frame = get(house, frame)
    for told in (job["error"]["detail"], frame["verdict"]["reasons"][0]["detail"]):
        assert code == "roi_empty" or "(500, 0) is outside the 96 x 64 pixels of the image." in told
    assert (frame["state"], frame["statistics"]) == ("read", [])
    assert code in frame["warnings"]
    set_roi(house, campaign, {"polygon": ROI})
    house.work()
    far = {"polygon": [[0, 0], [97, 0], [90, 40]]}
    assert "have 96 x 64 pixels" in set_roi(house, campaign, far, status=422)["detail"]
    refused = house.http.put(f"/v1/frames/{frame['id']}/roi", json=far)
    assert (refused.status_code, refused.json()["code"]) == (422, "roi_outside_frame")
    assert get(house, frame)["state"] == "extracted"
    assert code not in get(house, frame)["warnings"]


def test_a_frame_may_have_a_region_of_its_own(house):
    campaign = house.campaign()
    common = set_roi(house, campaign, {"polygon": ROI})
    moved = house.upload(campaign, house.frame_bytes(seed=1), role="light", roi=str(SMALL))
    other = house.upload(campaign, house.frame_bytes(seed=2), role="light")
    house.work()
    own = get(house, moved)["roi_id"]
    assert {row["roi"] for row in get(house, moved)["statistics"]} == {own}
    assert {row["roi"] for row in get(house, other)["statistics"]} == {common["id"]}
    answer = house.http.put(f"/v1/frames/{other['id']}/roi", json={"polygon": SMALL}).json()
    assert (answer["roi_id"], answer["state"]) == (own, "read")
    house.work()
    assert {row["roi"] for row in get(house, other)["statistics"]} == {common["id"], own}


def test_another_region_is_computed_and_the_older_statistics_stay(house, calls):
    campaign = house.campaign()
    first = set_roi(house, campaign, {"polygon": ROI})
    frame = house.upload(campaign, house.frame_bytes(), role="light")
    house.work()
    before = rows_of(get(house, frame), first)
    second = set_roi(house, campaign, {"polygon": SMALL})
    assert get(house, frame)["state"] == "read"
    house.work()
    after = get(house, frame)
    assert after["state"] == "extracted"
    assert rows_of(after, first) == before
    assert {row["n"] for row in rows_of(after, second)} != {row["n"] for row in before}
    assert calls == ["read_header", "inspect", "read_window", "read_window"]
    set_roi(house, campaign, {"polygon": ROI})
    house.work()
    assert calls[4:] == []


def test_the_same_bytes_in_the_same_region_are_measured_once(house, calls):
    content = house.frame_bytes()
    frames = []
    for _ in range(2):
        campaign = house.campaign()
        set_roi(house, campaign, {"polygon": ROI})
        frames.append(house.upload(campaign, content, role="light"))
        house.work()
    first, second = (get(house, frame) for frame in frames)
    assert first["statistics"] == second["statistics"]
    assert calls.count("read_window") == 1


def test_cells_that_a_spreadsheet_would_run_are_made_text(house):
    campaign = upload_campaign(house, isos=(3200,))
    hostile = '=HYPERLINK("x","y")'
    frame = house.upload(
        campaign, house.frame_bytes(seed=77), role="light", scene="level-1", filename=f"{hostile}.DNG"
    )
    version = calibrate(house, campaign, exclude=[{"frame_id": frame["id"], "reason": "@SUM(1)"}])
    text = house.http.get(f"/v1/calibrations/{version['id']}/points.csv").text
    name = next(point["frame"] for point in version["points"] if point["frame_id"] == frame["id"])
    assert name.startswith("=")
    assert "\n=" not in text
    assert ",=" not in text
    assert not [cell for cell in text.replace("\r\n", ",").split(",") if cell.startswith(('"=', "@", '"@'))]
    negative = [
        p for p in version["points"] for value in p.values() if isinstance(value, float) and value < 0
    ]
    for point in negative:
        for value in point.values():
            assert not isinstance(value, float) or f"'{value!r}" not in text


@pytest.mark.parametrize(
    ("asked", "first", "end"),
    [
        ("bytes=0-9", 0, 10),
        ("bytes=1048570-1048585", 1048570, 1048586),  # over the border of a proven piece
        ("bytes=1100000-", 1100000, 1200000),
        ("bytes=-5", 1199995, 1200000),
        ("bytes=1199999-9999999", 1199999, 1200000),
        ("bytes=0-1,10-11", None, None),
        ("bytes=9-1", None, None),
        ("bytes=-", None, None),
        ("lines=0-1", None, None),
        ("bytes=1200000-", 0, 0),
        ("bytes=-0", 0, 0),
    ],
)
def test_a_part_of_a_file_may_be_asked_for(house, large, asked, first, end):
    place, content = large
    answer = house.http.get(place, headers={"Range": asked})
    if first is None:
        assert (answer.status_code, answer.content) == (200, content)
    elif first == end:
        assert (answer.status_code, answer.json()["code"]) == (416, "range_outside")
        assert answer.headers["Content-Range"] == "bytes */1200000"
    else:
        assert (answer.status_code, answer.content) == (206, content[first:end])
        assert answer.headers["Content-Range"] == f"bytes {first}-{end - 1}/1200000"
        assert answer.headers["Content-Length"] == str(end - first)


def test_a_part_of_another_file_is_not_taken_for_one_of_this(house, large):
    place, content = large
    tag = house.http.get(place).headers["ETag"]
    for condition, status in ((tag, 206), ('"another"', 200), (f"W/{tag}", 200)):
        headers = {"Range": "bytes=0-9", "If-Range": condition}
        answer = house.http.get(place, headers=headers)
        assert (answer.status_code, len(answer.content)) == (status, 10 if status == 206 else len(content))


def test_head_answers_as_get_without_a_body(house, large):
    place, content = large
    head = house.http.head(place)
    assert (head.status_code, head.content) == (200, b"")
    assert head.headers["Content-Length"] == str(len(content))
    assert head.headers["Accept-Ranges"] == "bytes"
    part = house.http.head(place, headers={"Range": "bytes=0-9"})
    assert (part.status_code, part.headers["Content-Length"]) == (206, "10")
    assert house.http.head(place, headers={"If-None-Match": head.headers["ETag"]}).status_code == 304
    campaign = house.get(place.removesuffix("/content"))["campaign_id"]
    for path in (place, "/v1/cameras", f"/v1/campaigns/{campaign}/frames", "/v1/frames/x/content", "/docs"):
        answers = house.http.get(path), house.http.head(path)
        heads = [
            {name: each.headers[name] for name in each.headers if name not in CHANGING} for each in answers
        ]
        assert (answers[0].status_code, heads[0]) == (answers[1].status_code, heads[1]), path


CHANGING = {"x-request-id", "date"}


@pytest.fixture
def large(house):
    content = bytes(range(256)) * 4687 + bytes(128)
    frame = house.upload(house.campaign(), content, role="light")
    return f"/v1/frames/{frame['id']}/content", content
