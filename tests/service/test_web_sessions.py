"""Signing in to the pages: the cookie, the token against forged requests, and when a session ends."""

import stat
import time

import pytest
from starlette.testclient import TestClient

from service.http.counts import FORGOTTEN_AFTER_S, LONGEST_WAIT_S, Attempts, name_address
from service.http.signatures import SESSION_S, Sessions, sessions_of
from store.settings import Settings
from store.tables import WebSession
from tests.support.house import CAMERA, KEY

pytestmark = pytest.mark.either_database

PAGE = {"Accept": "text/html"}


@pytest.fixture
def house(sqlite_house):
    """One for all: nothing here depends on the database. Nobody has failed to sign in yet."""
    sqlite_house.app.state.context.__dict__.pop("attempts", None)
    return sqlite_house


def sign_in(client, key=KEY, **headers):
    form = {"key": key, "next": "/jobs"}
    return client.post("/sign-in", data=form, headers={**PAGE, **headers}, follow_redirects=False)


def token_of(house, client):
    sessions = house.app.state.context.sessions
    return sessions.csrf_token(client.cookies[sessions.cookie])


def test_a_key_opens_a_session_and_the_cookie_holds_nothing_of_it(house, visitor):
    answer = sign_in(visitor)
    assert (answer.status_code, answer.headers["location"]) == (303, "/jobs")
    cookie = answer.headers["set-cookie"]
    assert KEY not in cookie
    assert cookie.startswith(f"{house.app.state.context.sessions.cookie}=ses_")
    parts = {part.strip().lower() for part in cookie.split(";")[1:]}
    assert parts == {"httponly", f"max-age={SESSION_S}", "path=/", "samesite=strict"}
    assert visitor.get("/v1/cameras").status_code == 200
    visitor.base_url = "https://testserver"
    assert "Secure" in sign_in(visitor).headers["set-cookie"]


def test_a_browser_keeps_the_sessions_of_two_services_on_one_host_apart(house, visitor, tmp_path):
    here, there = (sessions_of(Settings(data=tmp_path / each)) for each in ("here", "there"))
    assert here.cookie != there.cookie
    assert here.cookie == sessions_of(Settings(data=tmp_path / "here")).cookie
    # it sends the cookies of both to either
    visitor.cookies.set(there.cookie, "ses_of_the_other")
    sign_in(visitor)
    assert visitor.get("/v1/cameras").status_code == 200
    token = token_of(house, visitor)
    visitor.post("/sign-out", data={"csrf_token": token}, headers=PAGE, follow_redirects=False)
    assert dict(visitor.cookies) == {there.cookie: "ses_of_the_other"}


def test_a_page_asks_for_a_key_and_remembers_where_one_wanted_to_go(visitor):
    answer = visitor.get("/jobs?state=failed", headers=PAGE, follow_redirects=False)
    assert (answer.status_code, answer.headers["location"]) == (303, "/sign-in?next=%2Fjobs%3Fstate%3Dfailed")


def test_who_follows_a_link_from_elsewhere_is_asked_again_by_a_page_of_ours(visitor):
    from_elsewhere = PAGE | {"Sec-Fetch-Site": "cross-site"}
    answer = visitor.get("/jobs?state=failed", headers=from_elsewhere)
    assert 'content="0; url=/sign-in?next=/jobs%3Fstate%3Dfailed"' in answer.text
    sign_in(visitor)
    own = visitor.get("/sign-in?next=/jobs%3Fstate%3Dfailed", headers=PAGE, follow_redirects=False)
    assert (own.status_code, own.headers["location"]) == (303, "/jobs?state=failed")


@pytest.mark.parametrize("key", ["", "stilb_unknown", "ключ", "\x00"])
def test_an_unknown_key_opens_nothing(visitor, key):
    answer = sign_in(visitor, key)
    assert answer.status_code == 401
    assert "This key is not known" in answer.text
    assert "set-cookie" not in answer.headers
    assert f'value="{key}"' not in answer.text or not key


def test_a_key_that_may_not_read_opens_nothing(house, visitor):
    made = house.post("/v1/keys", {"name": "camera car", "scopes": ["upload"]})
    answer = sign_in(visitor, made["secret"])
    assert (answer.status_code, "set-cookie" in answer.headers) == (401, False)
    assert "scope read" in answer.text


@pytest.mark.parametrize(
    "elsewhere",
    [
        "https://evil.example/",
        "//evil.example",
        "/\\evil.example",
        "\\\\evil",
        "/a\tb",
        "javascript:x",
        "",
        "é",
    ],
)
def test_signing_in_leads_nowhere_else(visitor, elsewhere):
    answer = visitor.post("/sign-in", data={"key": KEY, "next": elsewhere}, follow_redirects=False)
    assert (answer.status_code, answer.headers["location"]) == (303, "/")


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Sec-Fetch-Site": "cross-site"}, 403),
        ({"Sec-Fetch-Site": "same-site"}, 403),
        ({"Origin": "https://evil.example"}, 403),
        ({"Origin": "null"}, 403),
        ({"Sec-Fetch-Site": "same-origin", "Origin": "http://testserver"}, 303),
        ({"Origin": "http://testserver"}, 303),
    ],
)
def test_our_own_form_signs_in_and_another_sites_nobody(visitor, headers, status):
    answer = sign_in(visitor, **headers)
    assert (answer.status_code, "set-cookie" in answer.headers) == (status, status == 303)


def test_a_change_with_the_cookie_needs_the_pages_token(house, visitor):
    sign_in(visitor)
    earlier = token_of(house, visitor)
    sign_in(visitor)
    token = token_of(house, visitor)
    camera = CAMERA | {"serial": "made with a cookie"}
    assert token in visitor.get("/jobs", headers=PAGE).text
    for wrong in (None, "", token[:-1] + "é", "0" * 64, earlier):
        encoded = {} if wrong is None else {"X-CSRF-Token": wrong.encode()}
        answer = visitor.post("/v1/cameras", json=camera, headers=encoded)
        assert (answer.status_code, answer.json()["code"]) == (403, "csrf_token_wrong")
    assert camera["serial"] not in house.http.get("/v1/cameras").text
    assert visitor.post("/v1/cameras", json=camera, headers={"X-CSRF-Token": token}).status_code == 201


@pytest.mark.parametrize("method", ["POST", "PUT", "PATCH", "DELETE"])
def test_every_method_that_changes_needs_it(visitor, method):
    sign_in(visitor)
    path = {"DELETE": "/v1/keys/x", "PUT": "/v1/campaigns/x/roi", "PATCH": "/v1/organisation"}
    answer = visitor.request(method, path.get(method, "/v1/cameras"), json={})
    assert (answer.status_code, answer.json()["code"]) == (403, "csrf_token_wrong")


def test_what_is_sent_with_a_key_needs_no_token_and_the_key_counts(visitor):
    sign_in(visitor)
    by_key = {"Authorization": f"Bearer {KEY}"}
    assert visitor.post("/v1/cameras", json=CAMERA, headers=by_key).status_code in {200, 201}
    for authorization in ("Bearer stilb_wrong", "Basic eDp5", ""):
        answer = visitor.get("/v1/cameras", headers={"Authorization": authorization})
        assert answer.status_code == 401, authorization


def test_a_session_has_the_scopes_of_its_key_and_ends_when_it_is_revoked(house, visitor):
    made = house.post("/v1/keys", {"name": "guest", "scopes": ["read"]})
    sign_in(visitor, made["secret"])
    assert visitor.get("/v1/cameras").status_code == 200
    headers = {"X-CSRF-Token": token_of(house, visitor)}
    assert visitor.post("/v1/cameras", json=CAMERA, headers=headers).json()["code"] == "scope_missing"
    assert 'content="read"' in visitor.get("/", headers=PAGE).text
    (seen,) = house.get("/v1/sessions", key_id=made["id"])["items"]
    assert house.http.delete(f"/v1/keys/{made['id']}").status_code == 200
    assert house.get("/v1/sessions", key_id=made["id"])["items"] == []
    with house.database.reading() as session:
        assert session.get_one(WebSession, seen["id"]).ended_at is not None
    assert visitor.get("/v1/cameras").status_code == 401
    again = visitor.get("/", headers=PAGE)
    assert (again.url.path, "Your session has ended" in again.text) == ("/sign-in", True)
    visitor.cookies.clear()
    assert "Your session has ended" not in visitor.get("/sign-in", headers=PAGE).text


def test_signing_out_needs_the_token_takes_the_cookie_and_ends_the_session(house, visitor):
    sign_in(visitor)
    name, token = house.app.state.context.sessions.cookie, token_of(house, visitor)
    cookie = visitor.cookies[name]
    assert visitor.post("/sign-out", follow_redirects=False).status_code == 403
    answer = visitor.post("/sign-out", data={"csrf_token": token}, follow_redirects=False)
    assert (answer.status_code, answer.headers["location"]) == (303, "/sign-in")
    assert name not in visitor.cookies
    assert visitor.get("/v1/cameras").status_code == 401
    visitor.cookies.set(name, cookie)
    assert visitor.get("/v1/cameras").status_code == 401
    key = {"name": "made with an old cookie", "scopes": ["read"]}
    assert visitor.post("/v1/keys", json=key, headers={"X-CSRF-Token": token}).status_code == 401
    assert key["name"] not in house.http.get("/v1/keys").text


def test_a_person_lists_and_ends_their_sessions(house, visitor):
    made = house.post("/v1/keys", {"name": "guest", "scopes": ["read"]})
    sign_in(visitor, made["secret"], **{"User-Agent": "Netscape 4\x7f"})
    with house.with_key(made["secret"]) as elsewhere:
        (seen,) = elsewhere.get("/v1/sessions").json()["items"]
        assert (seen["key_id"], seen["key_name"], seen["browser"]) == (made["id"], "guest", "Netscape 4")
        assert seen["current"] is False
        assert seen["expires_at"] > seen["created_at"]
        (own,) = visitor.get("/v1/sessions").json()["items"]
        assert (own["id"], own["current"]) == (seen["id"], True)
        ended = elsewhere.delete(f"/v1/sessions/{seen['id']}")
        assert ended.json()["ended_at"]
        assert visitor.get("/v1/cameras").status_code == 401
        assert elsewhere.get("/v1/sessions").json()["items"] == []
    acts = [entry["action"] for entry in house.get("/v1/audit", subject_id=seen["id"])["items"]]
    assert acts == ["web_session.change", "web_session.create"]


def test_only_an_admin_sees_and_ends_those_of_others(house, visitor):
    made = [house.post("/v1/keys", {"name": name, "scopes": ["read"]}) for name in "ab"]
    sign_in(visitor, made[0]["secret"])
    (seen,) = house.get("/v1/sessions", key_id=made[0]["id"])["items"]
    with house.with_key(made[1]["secret"]) as other:
        assert other.get("/v1/sessions").json()["items"] == []
        assert other.delete(f"/v1/sessions/{seen['id']}").json()["code"] == "not_found"
        assert other.delete("/v1/sessions").json() == {"ended": 0}
    assert visitor.get("/v1/cameras").status_code == 200
    assert house.http.delete(f"/v1/sessions/{seen['id']}").status_code == 200
    assert visitor.get("/v1/cameras").status_code == 401


def test_all_other_sessions_end_at_once(house, visitor):
    made = house.post("/v1/keys", {"name": "tablet", "scopes": ["read"]})
    with house.with_key("none") as elsewhere:
        del elsewhere.headers["Authorization"]
        for browser in (elsewhere, visitor):
            sign_in(browser, made["secret"])
        ended = visitor.delete("/v1/sessions", headers={"X-CSRF-Token": token_of(house, visitor)})
        assert ended.json() == {"ended": 1}
        assert (elsewhere.get("/v1/cameras").status_code, visitor.get("/v1/cameras").status_code) == (
            401,
            200,
        )
    assert house.http.delete("/v1/sessions", params={"key_id": made["id"]}).json() == {"ended": 1}
    assert visitor.get("/v1/cameras").status_code == 401


@pytest.fixture
def clock(house):
    """The time by which attempts are counted; a process of its own for each test."""
    now = [1000.0]
    known = house.app.state.context.__dict__
    known["attempts"] = Attempts(lambda: now[0])
    yield now
    del known["attempts"]


def fail(client, times, key="stilb_wrong", **headers):
    return [sign_in(client, key, **headers).status_code for _ in range(times)]


def test_who_fails_again_and_again_waits_longer_each_time(visitor, clock):
    assert fail(visitor, 6) == [401] * 5 + [429]
    answer = sign_in(visitor, "stilb_wrong")
    assert answer.headers["retry-after"] == "1"
    assert "Try again in 1 s" in answer.text
    plain = visitor.post("/sign-in", data={"key": "x"}, headers={"Accept": "application/json"})
    assert (plain.status_code, plain.json()["code"]) == (429, "too_many_attempts")
    assert plain.json()["retryable"] is True
    waits = []
    for _ in range(12):
        clock[0] += 1 + waits[-1] if waits else 1
        assert fail(visitor, 1) == [401]
        waits.append(int(sign_in(visitor, "stilb_wrong").headers["retry-after"]))
    assert waits == [2, 4, 8, 16, 32, 64, 128, 256, 300, 300, 300, 300]
    clock[0] += LONGEST_WAIT_S + FORGOTTEN_AFTER_S + 1
    assert fail(visitor, 6) == [401] * 5 + [429]


@pytest.mark.usefixtures("clock")
def test_a_stranger_locks_nobody_out(house, visitor):
    made = house.post("/v1/keys", {"name": "in use", "scopes": ["read"]})
    idle = house.post("/v1/keys", {"name": "idle", "scopes": ["read"]})
    with house.with_key(made["secret"]) as client:
        assert client.get("/v1/cameras").status_code == 200
    assert fail(visitor, 20)[-1] == 429
    assert sign_in(visitor, made["secret"]).status_code == 303
    assert visitor.get("/v1/cameras").status_code == 200
    with TestClient(house.app, client=("203.0.113.9", 1)) as elsewhere:
        assert sign_in(elsewhere, idle["secret"]).status_code == 303


@pytest.mark.usefixtures("clock")
def test_a_key_that_is_revoked_waits_wherever_it_comes_from(house):
    made = house.post("/v1/keys", {"name": "lost", "scopes": ["read"]})
    house.http.delete(f"/v1/keys/{made['id']}")
    codes = []
    for number in range(7):
        with TestClient(house.app, client=(f"203.0.113.{number}", 1)) as client:
            codes += fail(client, 1, made["secret"])
    assert codes == [401] * 5 + [429] * 2


def test_an_address_of_ipv6_is_its_network():
    assert name_address("2001:db8::1") == name_address("2001:db8::ffff") != name_address("2001:db8:0:1::1")
    assert name_address("10.0.0.1") != name_address("10.0.0.2")


def test_a_token_is_known_again_until_it_ends(monkeypatch):
    sessions = Sessions(b"secret")
    token = sessions.open("ses_1")
    assert sessions.session_id_of(token) == "ses_1"
    now = time.time()
    monkeypatch.setattr("service.http.signatures.time.time", lambda: now + SESSION_S - 2)
    assert sessions.session_id_of(token) == "ses_1"
    monkeypatch.setattr("service.http.signatures.time.time", lambda: now + SESSION_S + 1)
    assert sessions.session_id_of(token) is None


def test_a_token_that_was_touched_or_made_elsewhere_is_none():
    sessions = Sessions(b"secret")
    _, expires, nonce, signature = sessions.open("ses_1").split(".")
    later = str(int(expires) + 1)
    for forged in (
        f"ses_2.{expires}.{nonce}.{signature}",
        f"ses_1.{later}.{nonce}.{signature}",
        f"ses_1.{expires}.{nonce}.",
        f"ses_1.{expires}.{nonce}",
        Sessions(b"another").open("ses_1"),
        sessions.csrf_token("ses_1"),
        "",
        "...",
        "\udcff",
    ):
        assert sessions.session_id_of(forged) is None, forged


def test_the_secret_is_kept_for_nobody_else_to_read(tmp_path):
    settings = Settings(data=tmp_path / "new")
    token = sessions_of(settings).open("ses_1")
    assert sessions_of(settings).session_id_of(token) == "ses_1"
    (kept,) = (tmp_path / "new").iterdir()
    assert stat.S_IMODE(kept.stat().st_mode) == 0o600
    assert len(kept.read_bytes()) == 32
    given = Settings(data=tmp_path / "other", session_secret="given")
    assert sessions_of(given).session_id_of(token) is None
    assert not (tmp_path / "other").exists()
