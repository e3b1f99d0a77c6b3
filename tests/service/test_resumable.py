"""Uploads that go on where they were cut: what a client of tus sees."""

import base64
import errno
import hashlib
import os
import time
from functools import partial

import pytest

from service.uploads.frames import MAX_FILE_BYTES
from store.blobs.partials import Partials
from tests.support.resumable import PIECE, TUS, begin_upload, describe, metadata

pytestmark = pytest.mark.either_database

CONTENT = bytes(range(256)) * 40


@pytest.fixture(scope="module")
def house(shared_house):
    return shared_house


@pytest.fixture
def place(house):
    return begin_upload(house, house.campaign()["id"], CONTENT, scene="level-1")


def append(house, place, offset, piece, *, status=204, **headers):
    answer = house.http.patch(place, content=piece, headers=PIECE | {"Upload-Offset": str(offset)} | headers)
    assert answer.status_code == status, answer.text
    return answer


def ask(house, place):
    answer = house.http.head(place, headers=TUS)
    assert answer.status_code == 200
    assert answer.headers["Cache-Control"] == "no-store"
    return int(answer.headers["Upload-Offset"])


def checksum(piece):
    return {"Upload-Checksum": f"sha256 {base64.b64encode(hashlib.sha256(piece).digest()).decode()}"}


def test_the_service_states_what_it_understands(house):
    said = house.http.options("/v1/uploads").headers
    extensions = {"creation", "creation-with-upload", "checksum", "expiration", "termination"}
    assert said["Tus-Version"] == "1.0.0"
    assert set(said["Tus-Extension"].split(",")) == extensions
    assert said["Tus-Checksum-Algorithm"] == "sha256"
    assert int(said["Tus-Max-Size"]) == MAX_FILE_BYTES


def test_pieces_become_a_frame_with_the_last_byte(house, place):
    count = partial(Partials.of(house.settings).count, f"org_{place.split('_')[1]}")
    under_way = count()
    assert "Content-Location" not in append(house, place, 0, CONTENT[:1000]).headers
    assert ask(house, place) == 1000
    last = append(house, place, 1000, CONTENT[1000:], **checksum(CONTENT[1000:]))
    frame = house.get(last.headers["Content-Location"])
    assert (frame["sha256"], frame["filename"], frame["scene"]) == (
        hashlib.sha256(CONTENT).hexdigest(),
        "a.DNG",
        "level-1",
    )
    # what is finished is counted never again
    assert count() == under_way - 1
    # who did not hear the answer asks, and sends nothing again
    assert ask(house, place) == len(CONTENT)
    assert append(house, place, len(CONTENT), b"").headers["Content-Location"] == f"/v1/frames/{frame['id']}"


def test_what_is_answered_has_been_synced(house, place, monkeypatch):
    synced, sync = [], os.fdatasync

    def fail_once(_fd):
        monkeypatch.setattr(os, "fdatasync", sync)  # as Linux does: the next one knows nothing of it
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(os, "fdatasync", lambda fd: (sync(fd), synced.append(fd)))
    assert append(house, place, 0, CONTENT[:1000]).headers["Upload-Offset"] == "1000"
    assert len(synced) == 2
    monkeypatch.setattr(os, "fdatasync", fail_once)
    refused = append(house, place, 1000, CONTENT[1000:2000], status=503)
    assert (refused.json()["code"], refused.json()["retryable"]) == ("storage_unavailable", True)
    assert ask(house, place) == 1000


def test_bytes_may_come_with_the_first_request(house):
    campaign = house.campaign()
    headers = describe(campaign["id"], CONTENT) | {"Content-Type": PIECE["Content-Type"]}
    answer = house.http.post("/v1/uploads", content=CONTENT, headers=headers)
    assert (answer.status_code, answer.headers["Upload-Offset"]) == (201, str(len(CONTENT)))
    assert house.get(answer.headers["Content-Location"])["campaign_id"] == campaign["id"]


def test_an_uploader_need_not_know_the_hash(house):
    campaign = house.campaign()["id"]
    place = begin_upload(house, campaign, CONTENT, sha256=None)
    last = append(house, place, 0, CONTENT)
    frame = house.get(last.headers["Content-Location"])
    assert frame["sha256"] == hashlib.sha256(CONTENT).hexdigest()
    again = append(house, begin_upload(house, campaign, CONTENT, sha256=None), 0, CONTENT)
    assert again.headers["Content-Location"] == last.headers["Content-Location"]


def test_another_offset_is_refused_and_stated(house, place):
    append(house, place, 0, CONTENT[:10])
    for offset in (0, 9, 11):
        refused = append(house, place, offset, b"x", status=409)
        assert (refused.json()["code"], refused.headers["Upload-Offset"]) == ("upload_offset_differs", "10")
    assert ask(house, place) == 10


def test_a_piece_with_another_checksum_is_not_kept(house, place):
    append(house, place, 0, CONTENT[:10])
    wrong = append(house, place, 10, b"y" * 20, status=460, **checksum(b"x" * 20))
    assert wrong.json()["code"] == "upload_checksum_differs"
    assert ask(house, place) == 10
    for unclear in ("md5 abc=", "sha256 é".encode()):
        append(house, place, 10, b"x", status=400, **{"Upload-Checksum": unclear})


def test_a_file_with_another_hash_begins_anew(house, place):
    spoilt = append(house, place, 0, b"?" * len(CONTENT), status=422)
    assert (spoilt.json()["code"], spoilt.headers["Upload-Offset"]) == ("digest_mismatch", "0")
    assert ask(house, place) == 0
    append(house, place, 0, CONTENT)
    assert ask(house, place) == len(CONTENT)


def test_more_bytes_than_announced_are_refused(house, place):
    assert append(house, place, 0, CONTENT + b"x", status=413).json()["code"] == "upload_too_large"
    chunked = append(house, place, 0, iter([CONTENT, b"x"]), status=413)
    assert chunked.json()["code"] == "upload_too_large"
    assert ask(house, place) in {0, len(CONTENT)}


def test_what_is_ended_or_expired_is_gone(house, place, monkeypatch):
    append(house, place, 0, CONTENT[:10])
    now = time.time()
    monkeypatch.setattr(time, "time", lambda: now + 8 * 24 * 3600)
    assert house.http.head(place, headers=TUS).status_code == 404
    monkeypatch.undo()
    assert house.http.delete(place, headers=TUS).status_code == 204
    assert append(house, place, 10, b"x", status=404).json()["code"] == "not_found"


def test_an_address_serves_without_a_key_while_the_key_that_began_it_is_in_force(house):
    campaign = house.campaign()
    key = house.post("/v1/keys", {"name": "team", "scopes": ["upload", "read"]})
    with house.with_key(key["secret"]) as team:
        answer = team.post("/v1/uploads", headers=describe(campaign["id"], CONTENT))
        place = answer.headers["Location"]
        del team.headers["Authorization"]
        headers = PIECE | {"Upload-Offset": "0"}
        assert team.patch(place, content=CONTENT[:10], headers=headers).status_code == 204
        assert house.http.delete(f"/v1/keys/{key['id']}").status_code < 300
        headers |= {"Upload-Offset": "10"}
        assert team.patch(place, content=CONTENT[10:], headers=headers).status_code == 404


def test_a_key_of_another_organisation_finds_nothing(house, place, stranger):
    assert stranger.head(place, headers=TUS).status_code == 404
    piece = {"content": CONTENT, "headers": PIECE | {"Upload-Offset": "0"}}
    assert stranger.patch(place, **piece).status_code == 404
    assert stranger.delete(place, headers=TUS).status_code == 404
    assert ask(house, place) == 0


def test_a_repeated_beginning_is_the_same_upload(house):
    campaign = house.campaign()["id"]
    headers = describe(campaign, CONTENT) | {"Idempotency-Key": f"of {campaign}"}
    places = {house.http.post("/v1/uploads", headers=headers).headers["Location"] for _ in range(2)}
    assert len(places) == 1
    other = describe(campaign, CONTENT + b"x") | {"Idempotency-Key": f"of {campaign}"}
    assert house.http.post("/v1/uploads", headers=other).json()["code"] == "idempotency_key_reused"


@pytest.mark.parametrize(
    ("changes", "status", "about"),
    [
        ({"Tus-Resumable": "0.2.2"}, 412, "Tus-Resumable"),
        ({"Upload-Length": "-1"}, 422, "Upload-Length"),
        ({"Upload-Length": "9" * 13}, 413, "2147483648 bytes"),
        ({"Upload-Length": "9" * 19}, 422, "at most 18 digits"),
        ({"Upload-Metadata": "role light"}, 422, "Upload-Metadata"),
        ({"Upload-Metadata": "role é".encode()}, 422, "Upload-Metadata"),
        ({"Upload-Metadata": metadata(role="light")}, 422, "campaign_id"),
        ({"Upload-Metadata": metadata(role="lihgt", campaign_id="x", sha256="0" * 64)}, 422, "role"),
        ({"Upload-Metadata": metadata(rule="light", role="light", campaign_id="x")}, 422, "rule"),
        ({"Upload-Metadata": metadata(role="light", campaign_id="x", sha256="0" * 64)}, 404, "campaign"),
    ],
)
def test_what_cannot_begin_says_why(house, changes, status, about):
    answer = house.http.post("/v1/uploads", headers=describe("x", CONTENT) | changes)
    assert answer.status_code == status, answer.text
    assert about in answer.text


def test_a_post_may_stand_for_another_method(house, place):
    override = {"X-HTTP-Method-Override": "PATCH", "Upload-Offset": "0"}
    assert house.http.post(place, content=CONTENT[:10], headers=PIECE | override).status_code == 204
    assert ask(house, place) == 10
    ended = house.http.post(place, headers=TUS | {"X-HTTP-Method-Override": "delete"})
    assert ended.status_code == 204
    assert house.http.head(place, headers=TUS).status_code == 404
