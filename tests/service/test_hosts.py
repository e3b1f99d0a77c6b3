"""What a stranger writes into `Host` comes back nowhere."""

import asyncio
import socket

import pytest
from starlette.testclient import TestClient

from store.settings import Settings
from tests.support.house import KEY

EVIL = ["evil.example", "evil.example:80", "127.0.0.1.evil.example", "a@evil.example", "8.8.8.8", "b/c"]


@pytest.fixture(scope="module")
def house(sqlite_house):
    sqlite_house.camera(serial="a")
    sqlite_house.camera(serial="b")
    return sqlite_house


@pytest.fixture
def ask(house, monkeypatch):
    """Ask with a Host under settings of a list of hosts."""

    def ask(host, listed="", path="/v1/cameras?limit=1", scheme="http"):
        monkeypatch.setitem(house.app.state.context.__dict__, "settings", Settings(allowed_hosts=listed))
        house.app.state.context.__dict__.pop("hosts", None)
        client = TestClient(
            house.app,
            base_url=f"{scheme}://testserver",
            headers={"Authorization": f"Bearer {KEY}", "Host": host},
        )
        return client.get(path, follow_redirects=False)

    yield ask
    house.app.state.context.__dict__.pop("hosts", None)


@pytest.mark.parametrize("host", EVIL)
def test_a_strange_name_is_answered_with_a_path(ask, host):
    answer = ask(host)
    assert answer.status_code == 200
    assert answer.json()["next"].startswith("/v1/cameras?limit=1&cursor=")
    redirect = ask(host, path="/v1/cameras/")
    assert host not in str(redirect.headers)
    assert redirect.headers["location"] == "/v1/cameras"


@pytest.mark.parametrize(
    "host",
    ["localhost", "localhost:8000", "127.0.0.1:8000", "[::1]:8000", "192.168.1.7:8000", socket.gethostname()],
)
def test_this_machine_and_its_network_need_no_setting(ask, host):
    assert ask(host).json()["next"].startswith(f"http://{host}/v1/cameras?")


def test_the_next_page_can_be_had_either_way(house, ask):
    following = house.http.get(ask("evil.example").json()["next"]).json()
    assert [camera["serial"] for camera in following["items"]] == ["b"]


def test_where_names_are_listed_others_are_refused(ask):
    listed = "https://calib.example, calib.local:8000"
    assert ask("calib.example", listed).json()["next"].startswith("https://calib.example/v1/")
    assert ask("calib.local:8000", listed).json()["next"].startswith("http://calib.local:8000/v1/")
    assert ask("localhost", listed).status_code == 200
    for host in [*EVIL, "calib.local", "sub.calib.example", ""]:
        answer = ask(host, listed)
        assert (answer.status_code, answer.json()["code"]) == (421, "host_not_allowed"), host
        assert "evil" not in answer.text
        assert ask(host, listed, path="/livez").status_code == 200


def test_a_request_names_one_host(house):
    async def ask(hosts, path):
        sent = []
        scope = {
            "type": "http",
            "method": "GET",
            "path": path,
            "raw_path": path.encode(),
            "root_path": "",
            "scheme": "http",
            "query_string": b"",
            "client": ("127.0.0.1", 1),
            "headers": [(b"host", host) for host in hosts],
        }

        async def receive():
            return {"type": "http.disconnect"}

        async def send(message):
            sent.append(message)

        await house.app(scope, receive, send)
        return sent[0]["status"]

    for hosts, status in (((), 400), ((b"localhost",) * 2, 400), ((b"localhost",), 401)):
        assert asyncio.run(ask(hosts, "/v1/cameras")) == status
    assert asyncio.run(ask((), "/livez")) == 200  # as probes ask that speak HTTP/1.0


def test_a_listed_scheme_makes_the_cookie_secure(house, ask):
    ask("calib.example", "https://calib.example")
    client = TestClient(house.app, headers={"Host": "calib.example"})
    answer = client.post("/sign-in", data={"key": KEY}, follow_redirects=False)
    assert "Secure" in answer.headers["set-cookie"]
