"""Look-ups from ready rows: the answers of the usual way, for exactly the same keys."""

import pytest

from service.coefficients import routes
from store.queries.organisations import create_key
from store.tables import ApiKey, Organisation, utc_now
from tests.support.campaigns import published_campaign

pytestmark = pytest.mark.either_database

QUERIES = (
    {},
    {"iso": 3200},
    {"name": "luminance_k", "iso": 3200},
    {"f_number": 5.6},
    {"f_number": 5.0, "name": "luminance_k"},
    {"at": "2026-06-01T00:00:00+02:00"},
    # PostgreSQL reads no such offset
    {"at": "2026-06-01T00:00:00+20:00"},
)


@pytest.fixture
def camera(staged):
    return f"/v1/cameras/{staged(published_campaign, isos=(3200,))['camera_id']}/coefficients"


def look_up(house, camera, **query):
    return house.http.get(camera, params={"method": "luminance", **query})


@pytest.mark.both_databases
def test_ready_answers_are_those_of_the_usual_way(house, camera, monkeypatch):
    look_up(house, camera)
    with monkeypatch.context() as patch:
        patch.setattr("service.http.auth.identify", None)
        quick = [look_up(house, camera, **query) for query in QUERIES]
    monkeypatch.setattr(routes, "_read_query", lambda _: None)
    usual = [look_up(house, camera, **query) for query in QUERIES]
    assert [each.status_code for each in quick] == [200] * len(QUERIES)
    assert [each.json() for each in quick] == [each.json() for each in usual]
    assert [each.headers["ETag"] for each in quick] == [each.headers["ETag"] for each in usual]
    assert len({each.headers["ETag"] for each in quick}) == len(QUERIES) - 2


def test_etag_changes_with_what_is_in_force(house, camera):
    tag = {"If-None-Match": look_up(house, camera).headers["ETag"]}
    same = house.http.get(camera, params={"method": "luminance"}, headers=tag)
    assert (same.status_code, same.content) == (304, b"")
    held = look_up(house, camera).json()["items"][0]["calibration_id"]
    house.publish({"id": held}, valid_from="2026-05-02T00:00:00Z", reason="again")
    renewed = house.http.get(camera, params={"method": "luminance"}, headers=tag)
    assert renewed.status_code == 200
    assert "again" in renewed.json()["items"][0]["why"]
    house.revoke({"id": held})
    assert house.http.get(camera, params={"method": "luminance"}, headers=tag).status_code == 404


def test_key_that_ends_opens_nothing_more(house, camera):
    with house.database.writing("test") as session:
        own = session.query(Organisation).one().id
        stranger = Organisation(name="another house")
        session.add(stranger)
        session.flush()
        for name, owner, scopes in (
            ("reads", own, ["read"]),
            ("writes", own, ["upload"]),
            ("strange", stranger.id, ["read"]),
        ):
            key = create_key(session, organisation_id=owner, name=name, scopes=scopes, secret=name)
            key.last_used_at = utc_now()

    def ask(secret):
        return house.with_key(secret).get(camera, params={"method": "luminance"}).status_code

    assert [ask(name) for name in ("reads", "writes", "strange", "unknown")] == [200, 403, 404, 401]
    with house.database.writing("test") as session:
        session.query(ApiKey).filter(ApiKey.name == "reads").one().revoked_at = utc_now()
    assert ask("reads") == 401


@pytest.mark.parametrize(
    "query", ["method=luminance&iso=1_000", "method=luminance&iso=1&iso=2", "method=luminance&isso=3200"]
)
def test_unclear_query_is_no_quick_look_up(sqlite_house, query, monkeypatch):
    monkeypatch.setattr(routes, "answer_held", None)
    assert routes._read_query(query.encode()) is None
    if "iso=1&" not in query:
        assert sqlite_house.http.get(f"/v1/cameras/x/coefficients?{query}").status_code == 422


def test_refusal_names_what_there_is_of_what_was_asked(house, camera):
    def told(query):
        answer = house.http.get(f"{camera}?method=luminance&{query}")
        assert answer.status_code == 404
        return answer.json()["detail"].partition("no such coefficient. ")[2]

    assert told("name=k") == "Its coefficients are dark_signal_dn, luminance_k."
    assert told("band=NIR&iso=3200") == "It knows no band."
    assert told("iso=50") == "It was calibrated for ISO 3200."


def test_plus_of_a_zone_may_stand_unescaped_in_an_address(house, camera):
    query = f"{camera}?method=luminance&at=2026-06-01T00:00:00"
    assert house.http.get(f"{query}+02:00").json() == house.http.get(f"{query}%2B02:00").json()
    assert house.http.get(f"{query}+02:00").status_code == 200
    assert house.http.get(f"{query} 02").status_code == 422
