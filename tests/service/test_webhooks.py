"""Events reach the address that asked for them: signed, again after a failure, and no private address."""

import base64
import hashlib
import hmac
import json
import socket
import threading
import time
from contextlib import suppress
from datetime import timedelta
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest
from pydantic import SecretStr
from sqlalchemy import update

from store.tables import Webhook, WebhookDelivery
from store.tables.base import utc_now
from store.webhooks import mend_due
from worker.webhooks import Deliveries, Unreachable, find_address, is_public

pytestmark = pytest.mark.either_database

EVENTS = ["job.succeeded", "job.failed"]


@pytest.fixture(scope="module")
def house(shared_house):
    return shared_house


class Receiver:
    """Keeps what it is sent, and answers as told."""

    def __init__(self):
        self.got, self.answers = [], []

        class Handler(BaseHTTPRequestHandler):
            def do_POST(handler):  # noqa: N805
                body = handler.rfile.read(int(handler.headers["Content-Length"]))
                self.got.append((dict(handler.headers), body))
                answer = self.answers.pop(0) if self.answers else 204
                if callable(answer):
                    answer(handler.wfile)
                    return
                handler.send_response(answer)
                handler.send_header("Location", "/elsewhere")
                handler.end_headers()

            do_GET = do_POST  # noqa: N815

            def log_message(self, *_):
                pass

        self.server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self.server.server_port}/hook"
        threading.Thread(target=self.server.serve_forever, kwargs={"poll_interval": 0.01}).start()


@pytest.fixture
def receiver():
    made = Receiver()
    yield made
    made.server.shutdown()
    made.server.server_close()


@pytest.fixture
def add(house):
    """Add a webhook as the operator of a service that lists this host; remove all of them in the end."""
    made = []
    context = house.app.state.context
    context.settings.__dict__["webhook_hosts"] = "127.0.0.1"

    def add(url, events=EVENTS):
        made.append(house.post("/v1/webhooks", {"url": url, "events": events}))
        return made[-1]

    yield add
    context.settings.__dict__["webhook_hosts"] = ""
    for hook in made:
        house.http.delete(f"/v1/webhooks/{hook['id']}")


def send(house, **settings):
    """Send what is due, to its end."""
    given = house.app.state.context.settings
    sender = Deliveries(house.database, given.model_copy(update={"webhook_hosts": "127.0.0.1"} | settings))
    sender.send_due()
    for future in list(sender._at_work.values()):
        future.result()


def make_due(house):
    with house.database.writing("test") as session:
        session.execute(update(WebhookDelivery).values(due_at=utc_now()))


def log(house, hook):
    return house.get(f"/v1/webhooks/{hook['id']}/deliveries")["items"]


def test_an_event_is_sent_signed_and_again_until_it_is_taken(house, receiver, add):
    hook = add(receiver.url)
    (listed,) = house.get("/v1/webhooks")["items"]
    assert "secret" not in listed
    job_id = house.upload(house.campaign(), house.frame_bytes(seed=91), role="dark")["job_id"]
    assert log(house, hook) == []
    house.work()
    (queued,) = log(house, hook)
    assert (queued["event"], queued["state"], queued["data"]["job_id"]) == ("job.succeeded", "queued", job_id)
    receiver.answers = [307, 204]
    send(house)
    send(house)  # not due yet
    (failed,) = log(house, hook)
    assert (failed["state"], failed["attempts"], failed["status"]) == ("queued", 1, 307)
    assert house.get("/v1/webhooks")["items"][0]["failing_since"]
    with house.database.writing("test") as session:  # as if the clock had been a day ahead
        session.execute(update(WebhookDelivery).values(due_at=utc_now() + timedelta(days=1)))
        mend_due(session)
    send(house)
    (sent,) = log(house, hook)
    assert (sent["state"], sent["attempts"], sent["status"], "error" in sent) == ("delivered", 2, 204, False)
    assert "failing_since" not in house.get("/v1/webhooks")["items"][0]
    (first, body), (second, again) = receiver.got
    assert (first["webhook-id"], body) == (second["webhook-id"], again)
    assert json.loads(body)["type"] == "job.succeeded"
    said = f"{first['webhook-id']}.{first['webhook-timestamp']}.".encode() + body
    digest = hmac.new(base64.b64decode(hook["secret"][6:]), said, hashlib.sha256).digest()
    assert first["webhook-signature"] == f"v1,{base64.b64encode(digest).decode()}"


def test_neither_a_slow_nor_an_endless_answer_holds_a_sender_up(house, receiver, add, monkeypatch):
    """What follows the status is read by nobody; each byte of the slow one comes soon enough for itself."""
    gushed = []

    def gush(wfile):
        wfile.write(b"HTTP/1.1 200 OK\r\nContent-Length: 1000000000\r\n\r\n")
        with suppress(OSError):
            for _ in range(1000):
                wfile.write(bytes(1 << 20))
                gushed.append(1 << 20)

    def drip(wfile):
        with suppress(OSError):
            wfile.write(b"HTTP/1.1 204 No Content\r\nX: ")
            for _ in range(50):
                wfile.write(b"x")
                time.sleep(0.1)

    hook = add(receiver.url)
    for answer, limit_s in ((gush, 15.0), (drip, 0.5)):
        monkeypatch.setattr("worker.webhooks._ANSWER_WITHIN_S", limit_s)
        receiver.answers = [answer]
        house.post(f"/v1/webhooks/{hook['id']}/test", {}, status=202)
        send(house)
    slow, endless = log(house, hook)
    assert (endless["state"], endless.get("error")) == ("delivered", None)
    assert sum(gushed) < 100 << 20
    assert (slow["state"], slow["error"]) == ("queued", "It did not answer within 0.5 s.")


def test_what_fails_for_days_is_disabled_and_can_be_enabled(house, receiver, add):
    gone, failing = add(receiver.url), add(receiver.url)
    for hook in (gone, failing):
        house.post(f"/v1/webhooks/{hook['id']}/test", {}, status=202)
    with house.database.writing("test") as session:
        session.get_one(Webhook, failing["id"]).failing_since = utc_now() - timedelta(days=6)
    receiver.answers = [410, 410]
    send(house)
    found = {each["id"]: each for each in house.get("/v1/webhooks")["items"]}
    assert [bool(found[hook["id"]].get("disabled_at")) for hook in (gone, failing)] == [True, True]
    place = f"/v1/webhooks/{gone['id']}"
    assert house.post(f"{place}/test", {}, status=409)["code"] == "conflict"
    enabled = house.http.patch(place, json={"enabled": True}).json()
    assert "disabled_at" not in enabled
    make_due(house)
    send(house)
    assert [each["state"] for each in log(house, gone)] == ["delivered"]


def test_the_last_attempt_gives_up(house, add):
    with socket.create_server(("127.0.0.1", 0)) as closed:
        url = f"http://127.0.0.1:{closed.getsockname()[1]}/"
    hook = add(url)
    house.post(f"/v1/webhooks/{hook['id']}/test", {}, status=202)
    with house.database.writing("test") as session:
        session.execute(update(WebhookDelivery).values(attempts=9))
    send(house)
    (given_up,) = log(house, hook)
    assert (given_up["state"], given_up["attempts"], "status" in given_up) == ("failed", 10, False)


def test_private_addresses_are_not_sent_to(house, receiver, add):
    hook = add(receiver.url)
    house.post(f"/v1/webhooks/{hook['id']}/test", {}, status=202)
    send(house, webhook_hosts="")
    assert "private address" in log(house, hook)[0]["error"]
    assert receiver.got == []
    with pytest.raises(Unreachable):
        find_address("localhost", 80, frozenset())


def test_the_database_cannot_sign_and_a_worker_with_another_key_says_so(house, receiver, add):
    hook = add(receiver.url)
    key = base64.b64decode(hook["secret"][6:])
    with house.database.reading() as session:
        row = session.get_one(Webhook, hook["id"])
        assert not any(word in str(vars(row)) for word in (hook["secret"], key.hex()))
    house.post(f"/v1/webhooks/{hook['id']}/test", {}, status=202)
    send(house, webhook_key=SecretStr("another"))
    assert "another STILB_WEBHOOK_KEY" in log(house, hook)[0]["error"]
    assert receiver.got == []
    make_due(house)
    send(house)
    assert log(house, hook)[0]["state"] == "delivered"


@pytest.mark.parametrize(
    "address",
    [
        *("127.0.0.1", "10.1.2.3", "169.254.169.254", "192.168.0.1", "100.64.0.1", "0.0.0.0", "224.0.0.1"),
        *("::1", "fe80::1%eth0", "fc00::1", "::ffff:10.0.0.1", "64:ff9b::a00:1", "2002:a00:1::", "::"),
    ],
)
def test_an_address_that_is_not_of_the_internet_is_told(address):
    assert not is_public(address)
    assert is_public("1.1.1.1")
    assert is_public("2606:4700:4700::1111")


def test_others_do_not_see_it_and_a_bad_address_is_refused(house, receiver, add, stranger):
    hook = add(receiver.url)
    assert stranger.get(f"/v1/webhooks/{hook['id']}/deliveries").status_code == 404
    assert stranger.delete(f"/v1/webhooks/{hook['id']}").status_code == 404
    assert stranger.get("/v1/webhooks").json()["items"] == []
    for url in ("http://example.org/", "ftp://127.0.0.1/", "https://user:key@example.org/", "https://"):
        house.post("/v1/webhooks", {"url": url, "events": EVENTS}, status=422)


def test_a_delivery_is_sent_again_on_request(house, receiver, add):
    hook = add(receiver.url)
    receiver.answers = [500, 204]
    sent = house.post(f"/v1/webhooks/{hook['id']}/test", {}, status=202)
    send(house)
    place = f"/v1/webhooks/{hook['id']}/deliveries/{sent['id']}/retry"
    assert house.post(place, {}, status=202)["attempts"] == 0
    send(house)
    (again,) = log(house, hook)
    assert (again["id"], again["state"], again["status"]) == (sent["id"], "delivered", 204)
    house.http.patch(f"/v1/webhooks/{hook['id']}", json={"enabled": False})
    assert house.post(place, {}, status=409)["code"] == "conflict"
