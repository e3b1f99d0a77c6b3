"""A frame after its upload: read, refused, corrected, measured in one region and then in another."""

import struct

import numpy as np
import pytest
import tifffile

from tests.support.frames import write_raw

pytestmark = pytest.mark.either_database

ROI = [[8, 8], [88, 8], [88, 56], [8, 56]]
SMALL = [[10, 10], [20, 10], [20, 20]]


def set_roi(house, campaign, body, *, status=200):
    return house.put(f"/v1/campaigns/{campaign['id']}/roi", body, status=status)


def get(house, frame):
    return house.get(f"/v1/frames/{frame['id']}")


def patch(house, frame, **changes):
    return house.patch(f"/v1/frames/{frame['id']}", changes)


def rows_of(frame, roi):
    return [row for row in frame["statistics"] if row["roi"] == roi["id"]]


@pytest.fixture
def calls(house, monkeypatch):
    """What the decoder is asked for."""
    asked, decoders = [], house.worker.decoders

    def note(inner):
        return lambda *args: asked.append(inner.__name__) or inner(*args)

    for name in ("read_header", "read_window", "inspect"):
        monkeypatch.setattr(decoders, name, note(getattr(decoders, name)))
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
    problem = house.get(f"/v1/frames/{frame['id']}/preview.png", status=404)
    assert (problem["code"], problem["retryable"]) == ("preview_not_ready", True)
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


def test_a_missing_exposure_is_typed_in_with_a_second_upload_or_a_correction(house, bare_tiff):
    campaign = house.campaign()
    frame = house.upload(campaign, bare_tiff, role="light", scene="a")
    house.work()
    refused = get(house, frame)
    assert (refused["state"], refused["refusal"]["code"]) == ("refused", "exposure_missing")
    assert "typed in (exposure_time_s)" in refused["refusal"]["detail"]
    typed = {"exposure_time_s": 0.02, "f_number": 5.6, "iso": 6400}
    again = house.upload(campaign, bare_tiff, status=200, role="light", scene="a", roi=str(SMALL), **typed)
    assert (again["id"], again["supplied"]) == (frame["id"], typed)
    house.work()
    accepted = get(house, frame)
    assert (accepted["state"], "refusal" in accepted) == ("extracted", False)
    assert {name: accepted[name] for name in typed} == typed
    assert accepted["exposure"]["iso_origin"] == "supplied"
    assert house.get(f"/v1/jobs/{again['job_id']}")["state"] == "succeeded"
    other = house.upload(house.campaign(), bare_tiff, role="light", exposure_time_s=0.02)
    house.work()
    assert get(house, other)["refusal"]["detail"].startswith("The file does not say the")
    patch(house, other, f_number=5.6, iso=6400)
    house.work()
    assert (get(house, other)["supplied"], get(house, other)["state"]) == (typed, "read")


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


def test_a_region_that_is_none(house):
    campaign = house.campaign()
    several, form = "either polygon, imagej or regions", "validation_failed"
    for body, code, words in (
        ({"polygon": [[0, 0], [9, 9], [9, 0], [0, 5]]}, "roi_self_intersecting", "crosses or touches itself"),
        ({"polygon": [[0, 0], [1, 1], [2, 2]]}, "roi_invalid", "encloses no area"),
        ({"polygon": [[0, 0], [1, 1], [0, 0]]}, "roi_invalid", "three different points"),
        ({"imagej": "makeOval(1,2,3,4)"}, "roi_invalid", "paste a line such as makePolygon"),
        ({"imagej": "makePolygon(1,2,3)"}, "roi_invalid", "every x needs its y"),
        ({"imagej": "makePolygon(1,2,nan,4,5,6)"}, "roi_invalid", "finite position"),
        ({"polygon": ROI, "imagej": "makeRectangle(1,2,3,4)"}, form, several),
        ({}, form, several),
        ({"polygon": [[1, 2], [3, 4], [5]]}, form, "body.polygon.2"),
        ({"polygon": [[1, 2], [3, 4]]}, form, "body.polygon"),
        ({"polygon": [[0, 0], [2e6, 0], [0, 9]]}, form, "body.polygon.1.0"),
    ):
        problem = set_roi(house, campaign, body, status=422)
        assert (problem["code"], words in problem["detail"]) == (code, True), body


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
    assert house.put(f"/v1/frames/{frame['id']}/roi", far, status=422)["code"] == "roi_outside_frame"
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
    answer = house.put(f"/v1/frames/{other['id']}/roi", {"polygon": SMALL})
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


def test_a_part_of_a_file_may_be_asked_for(house, large):
    place, content = large
    for asked, first, end in (
        ("bytes=0-9", 0, 10),
        ("bytes=1048570-1048585", 1048570, 1048586),  # over the border of a proven piece
        ("bytes=1100000-", 1100000, 1200000),
        ("bytes=-5", 1199995, 1200000),
        ("bytes=1199999-9999999", 1199999, 1200000),
    ):
        answer = house.http.get(place, headers={"Range": asked})
        assert (answer.status_code, answer.content) == (206, content[first:end]), asked
        assert answer.headers["Content-Range"] == f"bytes {first}-{end - 1}/1200000"
        assert answer.headers["Content-Length"] == str(end - first)
    for unclear in ("bytes=0-1,10-11", "bytes=9-1", "bytes=-", "lines=0-1"):
        answer = house.http.get(place, headers={"Range": unclear})
        assert (answer.status_code, answer.content) == (200, content), unclear
    for outside in ("bytes=1200000-", "bytes=-0"):
        answer = house.http.get(place, headers={"Range": outside})
        assert (answer.status_code, answer.json()["code"]) == (416, "range_outside"), outside
        assert answer.headers["Content-Range"] == "bytes */1200000"


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
