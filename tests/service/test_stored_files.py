"""A stored file that the disk spoilt or lost: never wrong bytes, never known, healed by the same upload."""

from dataclasses import replace

import httpx
import pytest
from sqlalchemy import select

from store.blobs import BlobDamaged, StorageUnavailable, StoredBlob
from store.blobs.objects import ObjectBlobs
from store.blobs.proof import PIECE_BYTES
from store.files import Files
from store.tables import AuditEntry, Blob
from tests.support.blobs import put, spoil, zero
from tests.support.live import serving

pytestmark = pytest.mark.either_database

REGION = [[8, 8], [60, 8], [60, 40]]


@pytest.fixture
def campaign(house):
    return house.campaign()


@pytest.fixture
def frame(house, campaign):
    """One that has been read, and that lies on the disk without being open anywhere."""
    sent = house.upload(campaign, house.frame_bytes(), role="light", scene="l", filename="a.dng")
    house.work()
    return sent


def content(house, frame):
    return house.http.get(f"/v1/frames/{frame['id']}/content")


def problem(answer):
    assert answer.headers["content-type"] == "application/problem+json"
    return answer.status_code, answer.json()["code"], answer.json()["retryable"]


def known(house, campaign, frame):
    return house.post(
        f"/v1/campaigns/{campaign['id']}/frames/known", {"sha256": [frame["sha256"]]}, status=200
    )


def send_again(house, campaign, **headers):
    answer = house.http.post(
        f"/v1/campaigns/{campaign['id']}/frames",
        content=house.frame_bytes(),
        params={"role": "light", "scene": "l", "filename": "a.dng"},
        headers=headers,
    )
    assert answer.status_code == 200, answer.text
    return answer.json()


@pytest.mark.parametrize("damage", ["damaged", "missing"])
def test_a_damaged_file_is_named_everywhere_until_the_same_upload_heals_it(house, campaign, frame, damage):
    original = content(house, frame).content
    if damage == "missing":
        spoil(house.blobs, house.folder, frame["sha256"], None)
    else:
        zero(house.folder, frame["sha256"], first=900, count=2000)

    assert problem(content(house, frame)) == (500, "stored_file_damaged", False)
    assert known(house, campaign, frame) == {"known": [], "unknown": [frame["sha256"]]}
    assert house.get(f"/v1/frames/{frame['id']}")["stored_file"] == damage
    assert house.get("/readyz")["damaged_files"] == 1
    assert f'stilb_damaged_files{{state="{damage}"}} 1' in house.http.get("/metrics").text

    # the region is drawn anew: the job fails with the very reason, and the frame is not blamed
    house.http.put(f"/v1/frames/{frame['id']}/roi", json={"polygon": REGION})
    house.work()
    job = next(job for job in house.get("/v1/jobs")["items"] if job["state"] == "failed")
    assert (job["error"]["code"], job["error"]["retryable"]) == ("stored_file_damaged", False)
    assert house.get(f"/v1/frames/{frame['id']}")["state"] == "read"

    send_again(house, campaign)
    assert content(house, frame).content == original
    assert known(house, campaign, frame)["unknown"] == []
    assert "stored_file" not in house.get(f"/v1/frames/{frame['id']}")
    assert f'stilb_damaged_files{{state="{damage}"}} 0' in house.http.get("/metrics").text
    assert house.work() == 1
    assert house.get(f"/v1/jobs/{job['id']}")["state"] == "succeeded"
    assert house.get(f"/v1/frames/{frame['id']}")["state"] == "extracted"
    with house.database.reading() as session:
        acts = session.scalars(select(AuditEntry.action).where(AuditEntry.subject_id == frame["sha256"]))
        assert list(acts) == ["blob.damage", "blob.heal"]


def test_a_missing_file_is_unknown_before_anybody_has_read_it(house, campaign, frame):
    spoil(house.blobs, house.folder, frame["sha256"], None)
    assert known(house, campaign, frame)["known"] == []
    assert house.get("/readyz")["damaged_files"] == 1


def test_who_began_to_read_before_the_cure_does_not_mark_the_file_again(house, campaign, frame):
    files = Files(house.database, house.blobs)

    def read_while_it_is_sent_again():
        with files.local(frame["sha256"]):
            send_again(house, campaign)
            raise BlobDamaged(frame["sha256"])

    with pytest.raises(StorageUnavailable, match="replaced"):
        read_while_it_is_sent_again()
    assert content(house, frame).status_code == 200


def test_a_replayed_upload_heals_too(house, campaign):
    """The answer is an earlier one; the bytes came again all the same."""
    key = {"Idempotency-Key": "the same"}
    query = {"role": "light", "scene": "l", "filename": "a.dng"}
    address = f"/v1/campaigns/{campaign['id']}/frames"
    frame = house.http.post(address, content=house.frame_bytes(), params=query, headers=key).json()
    house.work()
    zero(house.folder, frame["sha256"], first=900, count=2000)
    assert content(house, frame).status_code == 500
    again = house.http.post(address, content=house.frame_bytes(), params=query, headers=key)
    assert again.headers["Idempotent-Replayed"] == "true"
    assert content(house, frame).status_code == 200


def test_a_frame_that_was_never_read_is_not_refused_for_the_disk(house, campaign):
    frame = house.upload(campaign, house.frame_bytes(), role="light", scene="l", filename="a.dng")
    zero(house.folder, frame["sha256"], first=0, count=500)
    house.work()
    found = house.get(f"/v1/frames/{frame['id']}")
    assert (found["state"], found["stored_file"]) == ("received", "damaged")
    again = send_again(house, campaign)
    assert again["job_id"] == frame["job_id"], "it goes on: another would be one too many"
    assert house.work() == 1
    assert house.get(f"/v1/frames/{frame['id']}")["state"] == "read"


def test_a_file_of_an_older_stilb_is_proven_before_it_is_read(house, frame):
    with house.database.writing("test") as session:
        session.get_one(Blob, frame["sha256"]).digests = None
    assert content(house, frame).status_code == 200
    with house.database.writing("test") as session:
        row = session.get_one(Blob, frame["sha256"])
        assert row.digests is not None
        row.digests = None
    zero(house.folder, frame["sha256"], first=900, count=2000)
    assert problem(content(house, frame)) == (500, "stored_file_damaged", False)


def test_a_lost_preview_is_drawn_again(house, frame):
    with house.database.reading() as session:
        preview = session.scalar(select(Blob.sha256).where(Blob.sha256 != frame["sha256"]))
    before = house.http.get(f"/v1/frames/{frame['id']}/preview.png").content
    zero(house.folder, preview, first=60, count=9)
    assert problem(house.http.get(f"/v1/frames/{frame['id']}/preview.png"))[1] == "stored_file_damaged"
    house.http.put(f"/v1/frames/{frame['id']}/roi", json={"polygon": REGION})
    house.work()
    assert house.http.get(f"/v1/frames/{frame['id']}/preview.png").content == before


def test_a_download_breaks_at_the_first_wrong_piece(sqlite_house):
    """A part is never taken for the whole: the connection ends before the length that was announced."""
    house = sqlite_house
    data = bytes(range(256)) * 4 * 5120
    stored = put(house.blobs, data)
    campaign = house.campaign()
    frame = house.upload(campaign, data, role="light", scene="l", filename="a.dng")
    zero(house.folder, stored.sha256, first=3 * PIECE_BYTES + 1, count=20_000)
    with serving(house) as live:
        headers = house.http.headers
        got = b""
        with (  # noqa: PT012 (what came before it counts)
            httpx.stream("GET", f"{live.url}/v1/frames/{frame['id']}/content", headers=headers) as answer,
            pytest.raises(httpx.RemoteProtocolError),
        ):
            for chunk in answer.iter_raw():
                got += chunk
        assert (answer.status_code, answer.headers["content-length"]) == (200, str(len(data)))
        assert got == data[: 3 * PIECE_BYTES]
        again = httpx.get(f"{live.url}/v1/frames/{frame['id']}/content", headers=headers)
        assert problem(again) == (500, "stored_file_damaged", False)


def test_digests_in_the_database_that_are_wrong_are_put_right_by_a_proof(house, frame):
    """The whole hash decides, and it is the file's name."""
    with house.database.writing("test") as session:
        row = session.get_one(Blob, frame["sha256"])
        digests, row.digests = row.digests, b"\0" * 16
    assert content(house, frame).status_code == 500
    files = Files(house.database, house.blobs)
    assert files.prove(frame["sha256"]) == StoredBlob(frame["sha256"], frame["size_bytes"], digests)
    assert content(house, frame).status_code == 200


@pytest.mark.usefixtures("s3_bucket")
def test_a_bucket_that_lost_bytes_is_found_and_healed(house, campaign, tmp_path):
    """Through the local copy too: a spoilt copy is fetched anew, spoilt bytes in the bucket are damage."""
    blobs = ObjectBlobs("s3://raw/frames", tmp_path / "cache", retry_for_s=1)
    house.app.state.context = replace(house.app.state.context, blobs=blobs)
    house.worker = replace(house.worker, blobs=blobs)
    frame = house.upload(campaign, house.frame_bytes(), role="light", scene="l", filename="a.dng")
    house.work()
    copy = tmp_path / "cache" / frame["sha256"]
    zero(tmp_path / "cache", frame["sha256"], first=900, count=5000)
    house.http.put(f"/v1/frames/{frame['id']}/roi", json={"polygon": REGION})
    house.work()
    assert not copy.exists(), "the copy was damaged, and nothing is said of the file"
    assert house.get(f"/v1/frames/{frame['id']}")["state"] == "read"
    wrong = bytearray(house.frame_bytes())
    wrong[900:5900] = bytes(5000)
    spoil(blobs, tmp_path, frame["sha256"], bytes(wrong))
    assert problem(content(house, frame)) == (500, "stored_file_damaged", False)
    send_again(house, campaign)
    assert content(house, frame).content == house.frame_bytes()
    spoil(blobs, tmp_path, frame["sha256"], None)
    assert known(house, campaign, frame)["known"] == []
