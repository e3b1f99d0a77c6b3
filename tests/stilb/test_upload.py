"""Frames go from the disk in flat memory, whole, and once more after a lost connection."""

import base64
import hashlib
import os
import tracemalloc

import pytest

import stilb
from stilb.upload import Width
from tests.support.frames import write_frame

FRAME = {"id": "f-1", "sha256": "0" * 64, "size_bytes": 1, "filename": "a.dng", "state": "received"}
FRAME |= {"job_id": "j-1"}
MEGABYTE = 1 << 20


@pytest.fixture
def dng(tmp_path):
    path = tmp_path / "DJI 0001+ü&.DNG"
    path.write_bytes(bytes(range(256)) * 3072)
    return path


def test_the_bytes_arrive_with_their_hash_and_name(service, client, dng):
    service.will_answer(FRAME, status=201)
    frame = client.push("c-1", dng, role="light", scene="level-1")
    (asked,) = service.asked
    assert asked.body == dng.read_bytes()
    assert asked.path == "/v1/campaigns/c-1/frames"
    assert asked.query == {"role": "light", "scene": "level-1", "filename": "DJI 0001+ü&.DNG"}
    assert asked.headers["content-type"] == "application/octet-stream"
    assert asked.headers["content-length"] == str(dng.stat().st_size)
    assert asked.headers["x-content-sha256"] == hashlib.sha256(dng.read_bytes()).hexdigest()
    assert "transfer-encoding" not in asked.headers
    assert (frame.id, frame.job_id, frame.state) == ("f-1", "j-1", "received")


def test_a_frame_brings_its_own_region_and_exposure(service, client, dng):
    service.will_answer(FRAME, status=201)
    stated = {"role": "dark", "exposure_time_s": 0.01, "f_number": 1.7, "iso": 3200}
    client.push("c-1", dng, roi=[(1, 2), (3.5, 2), (3, 8)], **stated)
    said = {name: str(value) for name, value in stated.items()} | {"filename": dng.name}
    assert service.asked[0].query == said | {"roi": "[[1, 2], [3.5, 2], [3, 8]]"}


def place(offset, **more):
    return {"headers": {"Location": "/v1/uploads/u-1", "Upload-Offset": str(offset), **more}}


DONE = {"Content-Location": "/v1/frames/f-1"}


def test_a_connection_lost_in_mid_upload_goes_on_from_what_has_arrived(service, client, dng):
    service.will_answer(cut_after=1000)
    service.will_answer(status=201, **place(0))
    service.will_answer(cut_after=5000)
    service.will_answer(**place(5000))
    service.will_answer(status=204, **place(dng.stat().st_size, **DONE))
    service.will_answer(FRAME)
    reports = []
    frame = client.push("c-1", dng, role="light", scene="level-1", on_progress=reports.append)
    _, begun, lost, asked, rest, _ = service.asked
    pairs = (pair.split() for pair in begun.headers["upload-metadata"].split(","))
    said = {name: base64.b64decode(value).decode() for name, value in pairs}
    sha256 = hashlib.sha256(dng.read_bytes()).hexdigest()
    named = {"role": "light", "scene": "level-1", "filename": dng.name}
    assert said == {"campaign_id": "c-1", "sha256": sha256} | named
    assert begun.headers["upload-length"] == str(dng.stat().st_size)
    assert (asked.method, asked.path) == ("HEAD", "/v1/uploads/u-1")
    assert lost.body + rest.body == dng.read_bytes()
    assert rest.headers["upload-offset"] == "5000"
    assert frame.id == "f-1"
    last = reports[-1]
    assert (last.files_done, last.bytes_sent, last.bytes_total) == (1, dng.stat().st_size, dng.stat().st_size)


def test_an_upload_that_comes_no_further_ends(service, dng):
    service.will_answer(cut_after=1000)
    service.will_answer(status=201, **place(0))
    for _ in range(10):
        service.will_answer(cut_after=10)
        service.will_answer(**place(10))
    pauses_s = []
    settings = {"retries": 8, "backoff_s": 0.001, "on_retry": lambda _, pause_s: pauses_s.append(pause_s)}
    given_up = pytest.raises(stilb.Problem, match="does not answer")
    with stilb.Client(service.url, "k", **settings) as client, given_up:
        client.push("c-1", dng, role="light")
    assert len(pauses_s) == 10
    # who has been answered again does not wait as long as for a service that is away
    assert max(pauses_s) <= 0.008


def test_pieces_get_smaller_behind_a_proxy_that_holds_them_back(service, client, dng):
    size = dng.stat().st_size
    service.will_answer(cut_after=1000)
    service.will_answer(status=201, **place(0))
    for _ in range(2):
        service.will_answer(cut_after=1000)
        service.will_answer(**place(0))
    service.will_answer(status=204, **place(size // 16))
    service.will_answer(status=204, **place(size, **DONE))
    service.will_answer(FRAME)
    client.push("c-1", dng, role="light")
    pieces = [int(each.headers["content-length"]) for each in service.asked if each.method == "PATCH"]
    assert pieces == [size, size // 4, size // 16, size // 8]


def test_a_refusal_in_mid_upload_is_heard(service, client, dng):
    service.will_refuse(413, "frame_too_large")
    with pytest.raises(stilb.Problem, match="frame_too_large") as found:
        client.push("c-1", dng, role="light")
    assert found.value.__notes__ == [f"while sending {dng}"]


def test_several_files_share_role_and_scene_and_are_counted_together(service, client, tmp_path):
    paths = [tmp_path / f"{index}.dng" for index in range(6)]
    for path in paths:
        path.write_bytes(bytes(100))
        service.will_answer(FRAME, status=201)
    reports = []
    frames = client.push("c-1", paths, role="dark", scene="off", on_progress=reports.append)
    assert len(frames) == 6
    asked = {(each.query["filename"], each.query["role"], each.query["scene"]) for each in service.asked}
    assert asked == {(path.name, "dark", "off") for path in paths}
    assert [report.files_done for report in reports] == sorted(report.files_done for report in reports)
    assert reports[-1] == stilb.Progress(
        filename=reports[-1].filename, files_done=6, files_total=6, bytes_sent=600, bytes_total=600
    )


def test_the_same_file_twice_is_two_uploads(service, client, dng):
    """Whose hash is known is not read again."""
    for _ in range(2):
        service.will_answer(FRAME, status=200)
    reports = []
    one = stilb.Upload(campaign_id="c-1", path=dng, role="light", sha256="a" * 64)
    assert len(client.push_all([one, one], on_progress=reports.append)) == 2
    assert reports[-1].bytes_sent == reports[-1].bytes_total == 2 * dng.stat().st_size
    assert {asked.headers["x-content-sha256"] for asked in service.asked} == {"a" * 64}
    assert client.push_all([]) == []


def test_the_first_failure_stops_the_rest(service, client, dng):
    service.will_refuse(422, "not_a_raw_file")
    for _ in range(100):
        service.will_answer(FRAME)
    with pytest.raises(stilb.Problem, match="not_a_raw_file"):
        client.push("c-1", [dng] * 100, role="light")
    # some are under way by then, the more the slower the machine
    assert service.unsaid > 50


def test_small_files_widen_a_quick_line_alone():
    width, small, large = Width(None), 250_000, 3 << 20

    def fill(size):
        count = 0
        while width.has_room(size):
            width.begin(size)
            count += 1
        return count

    assert fill(small) == 2
    for _ in range(30):
        width.end(small, 0.2)
        fill(small)
    # sixteen of them are 4 MB
    assert fill(small) == 0
    for _ in range(16):
        width.end(small, 0.2)
    assert fill(large) == 2
    assert not width.has_room(1)
    for _ in range(2):
        width.end(large, 20)
    assert fill(1000) == 14
    width.end(1000, 0.2)
    assert (width.has_room(1000), width.has_room(1 << 20)) == (True, False)
    for _ in range(13):
        width.end(1000, 1.5)
    assert fill(1000) == 2
    # who names a number gets it
    width = Width(3)
    assert fill(large) == 3
    width.end(large, 0.1)
    assert fill(1) == 1


def test_a_large_file_is_never_in_memory(service, client, tmp_path):
    path = tmp_path / "large.dng"
    with path.open("wb") as file:
        file.truncate(48 * MEGABYTE)
    service.will_answer(status=201, **place(0))
    for piece in (1, 2, 3):
        done = DONE if piece == 3 else {}
        service.will_answer(status=204, forget_body=True, **place(16 * MEGABYTE * piece, **done))
    service.will_answer(FRAME)
    tracemalloc.start()
    try:
        client.push("c-1", path, role="light")
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 6 * MEGABYTE


def test_a_large_frame_names_its_job_also_when_it_is_sent_again(team, tmp_path):
    campaign = team.campaign()
    path = write_frame(tmp_path / "large.DNG", shape=(720, 800))
    assert path.stat().st_size > MEGABYTE
    frame = team.client.push(campaign.id, path, role="dark")
    assert team.client.wait(frame.job_id).state == "succeeded"
    assert team.client.push(campaign.id, path, role="dark").job_id == frame.job_id
    (known,) = team.client.known_frames(campaign.id, [frame.sha256])
    assert (known.frame_id, known.job_id) == (frame.id, frame.job_id)
    assert [job.id for job in team.client.jobs(subject=frame.id)] == [frame.job_id]


@pytest.mark.parametrize("shape", [(64, 96), (1000, 600)], ids=["small", "large"])
def test_a_file_that_has_grown_since_it_was_hashed_is_named_and_not_sent_for_ever(team, tmp_path, shape):
    path = write_frame(tmp_path / "grows.DNG", shape=shape)
    sha256 = hashlib.sha256(path.read_bytes()).hexdigest()
    path.write_bytes(path.read_bytes() + b"more")
    grown = stilb.Upload(campaign_id=team.campaign().id, path=path, role="light", sha256=sha256)
    told = []
    with stilb.Client(team.url, team.key, backoff_s=0.01, on_retry=lambda *said: told.append(said)) as client:
        (error,) = client.push_each([grown])
    assert isinstance(error, OSError)
    assert "grows.DNG is still being written: push again when it is complete" in str(error)
    assert len(told) <= 1


def test_a_file_that_shrinks_while_it_is_sent_is_named_and_ends_nothing(team, tmp_path):
    paths = [write_frame(tmp_path / name, shape=(1000, 600), serial=name) for name in ("cut.DNG", "b.DNG")]
    uploads = [stilb.Upload(campaign_id=team.campaign().id, path=path, role="light") for path in paths]

    def cut(_):
        os.truncate(paths[0], MEGABYTE)

    error, sent = team.client.push_each(uploads, concurrency=1, on_progress=cut)
    assert f"{paths[0]} is still being written" in str(error)
    assert sent.filename == "b.DNG"


def test_one_file_that_cannot_be_sent_does_not_keep_the_others(service, client, dng, tmp_path):
    service.will_refuse(422, "unsupported")
    service.will_answer(FRAME, status=201)
    paths = [tmp_path / "gone.dng", dng, dng]
    uploads = [stilb.Upload(campaign_id="c-1", path=path, role="light") for path in paths]
    gone, refused, sent = client.push_each(uploads, concurrency=1)
    assert isinstance(gone, FileNotFoundError)
    assert (refused.code, sent.id) == ("unsupported", "f-1")


@pytest.mark.parametrize("status", [401, 404, 507])
def test_what_concerns_every_file_is_raised(service, client, dng, status):
    service.will_refuse(status, "no_more")
    service.will_answer(FRAME, status=201)
    uploads = [stilb.Upload(campaign_id="c-1", path=dng, role="light")] * 2
    with pytest.raises(stilb.Problem, match="no_more"):
        client.push_each(uploads, concurrency=1)
