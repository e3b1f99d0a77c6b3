"""What one organisation may use: a number, a refusal that names it, and nobody else's matter."""

import time
from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta

import pytest
from psycopg.errors import DiskFull
from sqlalchemy import event, update
from sqlalchemy.exc import OperationalError

import stilb
from service.http.counts import Rates
from service.http.problems import Problem
from store.blobs.partials import Partial
from store.database import is_full
from store.queries import usage as usage_queries
from store.queries.usage import recount_all
from store.settings import Settings
from store.tables import Usage, utc_now
from tests.support.house import CAMERA, KEY
from tests.support.live import serving
from tests.support.resumable import PIECE, TUS, begin_upload, describe

pytestmark = pytest.mark.either_database


@pytest.fixture
def limit(house):
    """Set quotas of a house."""

    def limit(**quotas):
        settings = Settings(data=house.folder, allowed_hosts="testserver", **quotas)
        known = house.app.state.context.__dict__
        known["settings"] = settings
        for name in ("quotas", "rates"):
            known.pop(name, None)

    return limit


def usage(house):
    return house.get("/v1/organisation")["usage"]


def send(house, campaign, content, **headers):
    path = f"/v1/campaigns/{campaign['id']}/frames"
    return house.http.post(path, params={"role": "dark"}, content=content, headers=headers)


def begin(house, campaign, content, **headers):
    return house.http.post("/v1/uploads", headers=describe(campaign["id"], content) | headers)


def finish(house, place, content):
    return house.http.patch(place, content=content, headers=PIECE | {"Upload-Offset": "0"})


@pytest.mark.parametrize("quotas", [{"quota_bytes": 150}, {"quota_frames": 1}])
def test_an_upload_that_has_begun_keeps_its_room(house, limit, quotas):
    campaign = house.campaign()
    limit(**quotas)
    named = {"Idempotency-Key": "a"}
    begun = begin(house, campaign, b"a" * 100, **named)
    for refused in (begin(house, campaign, b"b" * 100), send(house, campaign, b"b" * 100)):
        assert (refused.status_code, refused.json()["code"]) == (507, "quota_exceeded"), refused.text
        assert refused.json()["used"] in {100, 1}
    again = begin(house, campaign, b"a" * 100, **named)
    assert (again.status_code, again.headers["Location"]) == (201, begun.headers["Location"])
    # also if the operator allows less meanwhile
    limit(quota_bytes=1, quota_frames=1)
    done = finish(house, begun.headers["Location"], b"a" * 100)
    assert (done.status_code, "Content-Location" in done.headers) == (204, True), done.text
    limit(**quotas)
    # its campaign has the file: it needs no more room
    repeated = begin(house, campaign, b"a" * 100, **named)
    assert finish(house, repeated.headers["Location"], b"a" * 100).status_code == 204
    assert usage(house)["stored_bytes"] == 100


def test_a_frame_whose_upload_was_not_told_so_takes_its_room_once(house, limit, monkeypatch):
    campaign = house.campaign()
    limit(quota_bytes=150)
    place = begin_upload(house, campaign["id"], b"a" * 100)
    with monkeypatch.context() as broken:
        broken.setattr(Partial, "become", lambda *_: (_ for _ in ()).throw(FileNotFoundError))
        assert finish(house, place, b"a" * 100).status_code == 404
    assert usage(house)["stored_bytes"] == 100
    assert send(house, campaign, b"b" * 50).status_code == 201
    assert "Content-Location" in house.http.head(place, headers=TUS).headers


def test_an_upload_that_is_ended_or_has_expired_gives_its_room_back(house, limit, monkeypatch):
    campaign = house.campaign()
    limit(quota_bytes=150)
    place = begin_upload(house, campaign["id"], b"a" * 100)
    assert house.http.delete(place).status_code == 204
    begin_upload(house, campaign["id"], b"b" * 100)
    now = time.time()
    monkeypatch.setattr(time, "time", lambda: now + 8 * 24 * 3600)
    assert send(house, campaign, b"c" * 100).status_code == 201


def test_of_uploads_that_begin_at_once_as_many_as_have_room(house, limit):
    campaign = house.campaign()
    limit(quota_bytes=250)
    with ThreadPoolExecutor(8) as threads:
        answers = list(threads.map(lambda n: begin(house, campaign, bytes([65 + n]) * 100), range(8)))
    assert sorted(answer.status_code for answer in answers) == [201] * 2 + [507] * 6


def test_what_is_used_is_shown(house, limit):
    assert usage(house) == {
        "frames": 0,
        "stored_bytes": 0,
        "jobs_waiting": 0,
        "jobs_waiting_limit": 50_000,
        "requests_in_minute": 1,
        "requests_in_minute_limit": 30_000,
    }
    campaign = house.campaign()
    for content in (b"a" * 10, b"b" * 20, b"a" * 10):
        send(house, campaign, content)
    limit(quota_bytes=100, quota_frames=7)
    used = usage(house)
    assert (used["frames"], used["stored_bytes"], used["jobs_waiting"]) == (2, 30, 2)
    assert (used["frames_limit"], used["stored_bytes_limit"]) == (7, 100)
    house.work()
    assert usage(house)["jobs_waiting"] == 0


@pytest.mark.parametrize(
    ("quotas", "name"), [({"quota_frames": 2}, "frames"), ({"quota_bytes": 25}, "stored_bytes")]
)
def test_above_it_nothing_is_kept_and_the_number_is_said(house, limit, quotas, name):
    limit(**quotas)
    campaign = house.campaign()
    assert [send(house, campaign, bytes([65 + n]) * 10).status_code for n in range(2)] == [201, 201]
    before = sorted(path.name for path in (house.folder / "blobs").rglob("*") if path.is_file())
    for content in (b"C" * 10, iter([b"C" * 5, b"C" * 5])):
        answer = send(house, campaign, content)
        problem = answer.json()
        assert (answer.status_code, problem["code"]) == (507, "quota_exceeded"), answer.text
        assert (problem["quota"], problem["limit"]) == (name, *quotas.values())
        assert problem["used"] == {"frames": 2, "stored_bytes": 20}[name]
        assert str(problem["limit"]) in problem["detail"]
        assert answer.headers["retry-after"] == "60"
    assert sorted(path.name for path in (house.folder / "blobs").rglob("*") if path.is_file()) == before
    assert send(house, campaign, b"A" * 10).status_code == 200
    assert usage(house)["frames"] == 2
    limit()
    assert send(house, campaign, b"C" * 10).status_code == 201


def test_a_long_queue_takes_no_more_until_it_is_shorter(house, monkeypatch):
    monkeypatch.setattr(usage_queries, "MOST_JOBS_WAITING", 2)
    campaign = house.campaign()
    for number in range(2):
        assert send(house, campaign, bytes([65 + number])).status_code == 201
    answer = send(house, campaign, b"C")
    assert (answer.status_code, answer.json()["quota"]) == (429, "jobs_waiting")
    assert (answer.json()["limit"], answer.headers["retry-after"]) == (2, "10")
    assert usage(house)["frames"] == 2
    house.work()
    assert send(house, campaign, b"C").status_code == 201


def test_the_quota_of_one_is_not_that_of_another(house, limit, stranger):
    limit(quota_frames=1)
    assert send(house, house.campaign(), b"A").status_code == 201
    camera = stranger.post("/v1/cameras", json={"make": "DJI", "model": "X", "serial": "1"}).json()
    campaign = stranger.post("/v1/campaigns", json={"camera_id": camera["id"], "method": "luminance"}).json()
    path = f"/v1/campaigns/{campaign['id']}/frames?role=dark"
    assert stranger.post(path, content=b"A").status_code == 201
    assert stranger.post(path, content=b"B").status_code == 507


def test_who_come_at_once_are_counted_one_after_the_other(house, limit):
    limit(quota_frames=5)
    campaign = house.campaign()
    with ThreadPoolExecutor(8) as threads:
        answers = list(threads.map(lambda n: send(house, campaign, bytes([65 + n])).status_code, range(12)))
    assert sorted(answers) == [201] * 5 + [507] * 7
    assert usage(house)["frames"] == 5


def test_a_wrong_count_heals_before_anybody_is_refused(house, limit):
    limit(quota_frames=3)
    campaign = house.campaign()
    send(house, campaign, b"A")
    with house.database.writing("test") as session:
        session.execute(update(Usage).values(frames=99, counted_at=utc_now() - timedelta(hours=1)))
    assert send(house, campaign, b"B").status_code == 201
    assert usage(house)["frames"] == 2
    with house.database.writing("test") as session:
        session.execute(update(Usage).values(frames=0, stored_bytes=0))
        recount_all(session)
    assert (usage(house)["frames"], usage(house)["stored_bytes"]) == (2, 2)


def test_requests_are_counted_by_the_minute(house, limit, stranger):
    limit(quota_requests_per_minute=5)
    answers = [house.http.get("/v1/cameras") for _ in range(6)]
    assert [answer.status_code for answer in answers] == [200] * 5 + [429]
    problem = answers[-1].json()
    assert (problem["code"], problem["limit"], problem["retryable"]) == ("too_many_requests", 5, True)
    assert 1 <= int(answers[-1].headers["retry-after"]) <= 72
    assert stranger.get("/v1/cameras").status_code == 200
    assert house.http.get("/livez").status_code == 200


def test_the_last_minute_counts_wherever_it_begins():
    now = [120.0]
    rates = Rates(60, lambda: now[0])
    for _ in range(60):
        rates.take("org")
    assert rates.used("org") == 60
    with pytest.raises(Problem) as refused:
        rates.take("org")
    now[0] += int(refused.value.headers["Retry-After"]) - 2
    with pytest.raises(Problem):
        rates.take("org")
    now[0] += 2
    rates.take("org")
    now[0] = 210.0
    assert rates.used("org") == 31
    for _ in range(29):
        rates.take("org")
    with pytest.raises(Problem):
        rates.take("org")
    now[0] = 400.0
    assert rates.used("org") == 0
    Rates(0).take("org")


def test_who_sends_a_large_file_hears_why_it_is_refused(sqlite_house, monkeypatch, tmp_path):
    """Before its bytes are sent, and not as a connection that breaks."""
    path = tmp_path / "large.dng"
    path.write_bytes(b"x" * (8 << 20))
    with serving(sqlite_house) as live, stilb.Client(live.url, KEY, retries=0) as client:
        context = sqlite_house.app.state.context
        smaller = context.settings.model_copy(update={"quota_bytes": 1 << 20})
        monkeypatch.setitem(context.__dict__, "settings", smaller)
        campaign = sqlite_house.campaign()["id"]
        with pytest.raises(stilb.Problem) as refused:
            client.push(campaign, path, role="dark")
    assert (refused.value.status, refused.value.code) == (507, "quota_exceeded")
    assert refused.value.retry_after_s == 60
    assert (refused.value.raw["limit"], refused.value.raw["used"]) == (1 << 20, 0)


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
def test_a_database_without_room_is_no_database_that_does_not_answer(house):
    known = house.camera()

    def take_all_room(connection, _record):
        connection.execute("PRAGMA max_page_count = 1")

    house.database.dispose()
    event.listen(house.database.engine, "connect", take_all_room)
    note = "x" * 900
    answers = [
        house.http.post("/v1/cameras", json={**CAMERA, "serial": str(i), "note": note}) for i in range(50)
    ]
    refused = [answer for answer in answers if answer.status_code != 201]
    assert {(answer.status_code, answer.json()["code"]) for answer in refused} == {(507, "storage_full")}
    assert refused[0].json()["retryable"] is True
    assert refused[0].headers["Retry-After"]
    assert house.get(f"/v1/cameras/{known['id']}") == known


def test_postgresql_says_it_its_own_way():
    assert is_full(OperationalError("INSERT", {}, DiskFull("could not extend file")))
    assert not is_full(OperationalError("INSERT", {}, Exception("server closed the connection")))
