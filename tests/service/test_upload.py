"""Files on their way in: raw or as a form, announced or not, whole or cut, with any name."""

import base64
import hashlib
from concurrent.futures import ThreadPoolExecutor
from urllib.parse import unquote

import pytest
from sqlalchemy import event, func, select, update

from store.audit_check import check_audit
from store.tables import Blob, FrameRow, Job, Usage, utc_now
from tests.support.blobs import files
from tests.support.waiting import wait_for

CONTENT = b"raw" * 1000
SHA256 = hashlib.sha256(CONTENT)
BOUNDARY = "xyz"


@pytest.fixture(scope="module")
def house(shared_house):
    return shared_house


@pytest.fixture
def nothing_left(house):
    """Fails when the test leaves a row or a file."""
    before = kept(house)
    yield
    assert kept(house) == before


def form(*parts: tuple[str, str | None, bytes], end: bool = True) -> bytes:
    body = b""
    for name, filename, content in parts:
        named = f'; filename="{filename}"' if filename is not None else ""
        head = f'--{BOUNDARY}\r\nContent-Disposition: form-data; name="{name}"{named}\r\n\r\n'
        body += head.encode() + content + b"\r\n"
    return body + (f"--{BOUNDARY}--\r\n".encode() if end else b"")


def send(house, content, *, headers=None, campaign=None, **query):
    campaign = campaign or house.campaign()
    path = f"/v1/campaigns/{campaign['id']}/frames"
    return house.http.post(path, params={"role": "light"} | query, content=content, headers=headers or {})


def send_form(house, body, *, boundary=f"; boundary={BOUNDARY}", **query):
    return send(house, body, headers={"Content-Type": f"multipart/form-data{boundary}"}, **query)


def kept(house):
    with house.database.reading() as session:
        frames = session.scalar(select(func.count()).select_from(FrameRow))
        blobs = session.scalar(select(func.count()).select_from(Blob))
    return frames, blobs, len(files(house.folder / "blobs"))


def test_a_form_is_the_same_as_the_bytes_themselves(house):
    campaign = house.campaign()
    raw = send(house, CONTENT, campaign=campaign, filename="DJI_0001.DNG")
    body = form(("note", None, b"x"), ("file", "DJI_0001.DNG", CONTENT), ("after", None, b"y"))
    again = send_form(house, body, campaign=campaign)
    assert (raw.status_code, again.status_code) == (201, 200)
    assert {n: v for n, v in raw.json().items() if n != "verdict"} == again.json()
    assert raw.json()["sha256"] == SHA256.hexdigest()
    content = house.http.get(f"/v1/frames/{raw.json()['id']}/content")
    assert (content.content, content.headers["content-length"]) == (CONTENT, str(len(CONTENT)))


def test_the_name_of_the_part_is_the_name_of_the_file(house):
    assert send_form(house, form(("file", "DJI_0002.DNG", CONTENT))).json()["filename"] == "DJI_0002.DNG"
    named = send_form(house, form(("file", "DJI_0002.DNG", CONTENT)), filename="mine.DNG")
    assert named.json()["filename"] == "mine.DNG"


@pytest.mark.either_database
@pytest.mark.parametrize(
    ("body", "code", "detail"),
    [
        (form(("data", "a", CONTENT)), "bad_request", "0 parts named 'file'"),
        (form(("file", "a", CONTENT), ("file", "b", CONTENT)), "bad_request", "2 parts named 'file'"),
        (form(("file", "a", CONTENT), end=False), "upload_incomplete", "ends too early"),
        (form(("file", "a", CONTENT))[:200], "upload_incomplete", "ends too early"),
        (b"", "upload_incomplete", "ends too early"),
        (b"no form at all", "bad_request", "cannot be read"),
    ],
)
@pytest.mark.usefixtures("nothing_left")
def test_a_form_that_is_not_usable_leaves_nothing(house, body, code, detail):
    answer = send_form(house, body)
    assert (answer.status_code, answer.json()["code"]) == (400, code)
    assert detail in answer.json()["detail"]
    assert answer.json()["retryable"] is (code == "upload_incomplete")


def test_a_form_without_a_boundary(house):
    answer = send_form(house, form(("file", "a", CONTENT)), boundary="")
    assert (answer.status_code, answer.json()["code"]) == (400, "bad_request")
    assert "boundary" in answer.json()["detail"]


@pytest.mark.parametrize(
    "headers",
    [
        {"X-Content-SHA256": SHA256.hexdigest()},
        {"X-Content-SHA256": SHA256.hexdigest().upper()},
        {"Repr-Digest": f"sha-256=:{base64.b64encode(SHA256.digest()).decode()}:"},
        {"Repr-Digest": f"sha-512=:AAAA:, sha-256=:{base64.b64encode(SHA256.digest()).decode()}:"},
        {"Repr-Digest": "sha-512=:AAAA:"},
    ],
)
def test_an_announced_hash_that_fits(house, headers):
    assert send(house, CONTENT, headers=headers).status_code == 201


@pytest.mark.either_database
@pytest.mark.parametrize(
    ("headers", "status", "code"),
    [
        ({"X-Content-SHA256": "0" * 64}, 422, "digest_mismatch"),
        ({"Repr-Digest": f"sha-256=:{base64.b64encode(bytes(32)).decode()}:"}, 422, "digest_mismatch"),
        ({"X-Content-SHA256": "0" * 63}, 400, "bad_request"),
        ({"X-Content-SHA256": ""}, 400, "bad_request"),
        ({"Repr-Digest": "sha-256=:AAAA:"}, 400, "bad_request"),
        ({"Repr-Digest": "sha-256=:A:"}, 400, "bad_request"),
    ],
)
@pytest.mark.usefixtures("nothing_left")
def test_an_announced_hash_that_does_not_fit_leaves_nothing(house, headers, status, code):
    answer = send(house, CONTENT, headers=headers)
    assert (answer.status_code, answer.json()["code"]) == (status, code)
    assert answer.json()["retryable"] is (status == 422)


@pytest.mark.parametrize("announced", [True, False])
@pytest.mark.usefixtures("nothing_left")
def test_a_file_above_the_limit_is_refused_and_leaves_nothing(house, announced, monkeypatch):
    monkeypatch.setattr("service.uploads.frames.MAX_FILE_BYTES", 2000)
    answer = send(house, CONTENT if announced else iter([CONTENT[:1500], CONTENT[1500:]]))
    assert (answer.status_code, answer.json()["code"]) == (413, "upload_too_large")
    assert "2000 bytes" in answer.json()["detail"]


def test_an_empty_file_is_taken_and_refused_with_a_sentence(house):
    frame = send(house, b"").json()
    assert (frame["state"], frame["size_bytes"]) == ("received", 0)
    house.work()
    frame = house.get(f"/v1/frames/{frame['id']}")
    assert frame["refusal"] == {
        "code": "empty_file",
        "detail": "The file is empty. Copy it from the camera's card again.",
    }
    assert house.http.get(f"/v1/frames/{frame['id']}/content").content == b""
    preview = house.get(f"/v1/frames/{frame['id']}/preview.png", status=404)
    assert (preview["code"], preview["retryable"]) == ("preview_not_ready", False)


@pytest.mark.either_database
@pytest.mark.parametrize(
    ("name", "kept_as"),
    [
        ("../../etc/passwd", "passwd"),
        ("C:\\cards\\DJI_0001.DNG", "DJI_0001.DNG"),
        ("a\r\nSet-Cookie: x=1\x00\x1b.DNG", "aSet-Cookie: x=1.DNG"),
        ("x" * 10_000 + ".DNG", "x" * 251 + ".DNG"),
        ("con.漢" + "x" * 300, "con.漢" + "x" * 250),
        ("\U0001f681 Überflug.DNG", "\U0001f681 Überflug.DNG"),
        ("gpj\u202eGND.exe", "gpjGND.exe"),
        ('a"; filename="b', 'a"; filename="b'),
        ("..", "unnamed"),
        ("folder/", "unnamed"),
        ("\x00", "unnamed"),
    ],
)
def test_a_hostile_name_comes_back_harmless(house, name, kept_as):
    frame = send(house, CONTENT, filename=name).json()
    assert frame["filename"] == kept_as
    disposition = house.http.get(f"/v1/frames/{frame['id']}/content").headers["content-disposition"]
    prefix = "attachment; filename*=UTF-8''"
    assert disposition.startswith(prefix)
    assert disposition.isascii()
    assert not set(disposition.removeprefix(prefix)) & set('";/\\ \r\n')
    assert unquote(disposition.removeprefix(prefix)) == kept_as


def test_a_hostile_name_of_a_part(house):
    name = "../a\\b/" + "\u202e" + "y" * 3000
    assert send_form(house, form(("file", name, CONTENT))).json()["filename"] == "y" * 255


@pytest.mark.either_database
@pytest.mark.parametrize(
    ("query", "field"),
    [
        ({"role": "sun"}, "query.role"),
        ({"iso": "inf"}, "query.iso"),
        ({"f_number": "1e400"}, "query.f_number"),
        ({"exposure_time_s": "0"}, "query.exposure_time_s"),
        ({"scen": "a"}, "query.scen"),
        ({"roi": "[[1,2],[3"}, "query.roi"),
        ({"roi": "[" * 5000}, "query.roi"),
        ({"roi": "[[0,0],[9,0],[NaN,9]]"}, "query.roi.polygon.2.0"),
        ({"scene": "a\x00"}, "query.scene"),
    ],
)
def test_what_is_said_of_a_file_is_checked_before_it_is_read(house, query, field):
    answer = send(house, CONTENT, **query)
    assert (answer.status_code, answer.json()["code"]) == (422, "validation_failed")
    assert answer.json()["errors"][0]["field"] == field


@pytest.mark.usefixtures("nothing_left")
def test_an_unknown_campaign_is_told_before_the_upload(house):
    answer = send(house, CONTENT, campaign={"id": "cmp_no"})
    assert answer.status_code == 404


def test_frames_that_arrive_at_once_share_a_commit_and_no_refusal(house, monkeypatch):
    campaign, engine, commits = house.campaign(), house.database.engine, []
    path = f"/v1/campaigns/{campaign['id']}/frames?role=dark"
    house.upload(campaign, b"first", role="dark")
    together, arrived = house.app.state.context.together, []
    do = together.do

    async def arrive(*request):
        arrived.append(request)
        return await do(*request)

    monkeypatch.setattr(together, "do", arrive)

    def count(connection):
        commits.append(connection)

    def send_all(contents, reused=None):
        def send_one(content):
            headers = {"Idempotency-Key": "reused"} if content == reused else {}
            return house.http.post(path, content=content, headers=headers).status_code

        with ThreadPoolExecutor(8) as threads:
            with house.database.writing("test") as session:
                session.execute(update(Usage).values(counted_at=utc_now()))
                sent = [threads.submit(send_one, content) for content in contents]
                wait_for(lambda: len(arrived) == len(contents))
            arrived.clear()
            commits.clear()
            return sorted(each.result() for each in sent)

    event.listen(engine, "commit", count)
    try:
        assert send_all([b"A", b"B", b"C", b"D", b"D"], reused=b"A") == [200, 201, 201, 201, 201]
        assert len(commits) <= 3
        assert send_all([b"E", b"F", b"G", b"H"], reused=b"H") == [201, 201, 201, 422]
    finally:
        event.remove(engine, "commit", count)
    frames = [frame["id"] for frame in house.get(f"/v1/campaigns/{campaign['id']}/frames")["items"]]
    with house.database.reading() as session:
        jobs = session.scalars(select(Job.subject_id).where(Job.subject_id.in_(frames)).order_by(Job.id))
        assert (len(frames), sorted(jobs)) == (8, sorted(frames))
    assert check_audit(house.database)[1] is None
