"""Answers that are text are compressed for who accepts it, and nothing else is."""

import gzip
import json

import pytest
from fastapi import FastAPI, Request, Response
from fastapi.responses import StreamingResponse
from starlette.testclient import TestClient

from service.http import answers
from service.http.middleware import Compression

GZIP = {"Accept-Encoding": "GZIP"}
LONG = b"0123456789" * 200
PACKED = [
    "application/json",
    "application/geo+json",
    "application/problem+json",
    "text/csv; charset=utf-8",
    "text/html",
]
LEFT = ["text/event-stream", "image/png", "image/svg+xml", "application/pdf", "application/octet-stream"]


@pytest.fixture(scope="module")
def client():
    app = FastAPI()
    app.add_middleware(Compression)
    answers.install(app)

    @app.get("/whole")
    def send_whole(request: Request, kind: str, count: int = len(LONG)) -> Response:
        return Response(LONG[:count], headers=answers.immutable(request, "tag"), media_type=kind)

    @app.get("/stream")
    def stream(kind: str) -> Response:
        return StreamingResponse(iter([LONG, LONG]), media_type=kind)

    return TestClient(app)


@pytest.mark.parametrize(
    ("kind", "coding"), [*((each, "gzip") for each in PACKED), *((each, None) for each in LEFT)]
)
def test_text_is_packed_and_nothing_else(client, kind, coding):
    whole = client.get("/whole", params={"kind": kind}, headers=GZIP)
    streamed = client.get("/stream", params={"kind": kind}, headers=GZIP)
    assert (whole.content, streamed.content) == (LONG, LONG * 2)
    assert {whole.headers.get("content-encoding"), streamed.headers.get("content-encoding")} == {coding}
    for refused in ("identity", "gzip;q=0, br"):
        plain = client.get("/whole", params={"kind": kind}, headers={"Accept-Encoding": refused})
        assert "content-encoding" not in plain.headers
    short = client.get("/whole", params={"kind": kind, "count": 900}, headers=GZIP)
    assert "content-encoding" not in short.headers


def test_a_packed_answer_has_a_tag_of_its_own(client):
    plain, packed = (
        client.get("/whole?kind=text/csv", headers={"Accept-Encoding": each}) for each in ("identity", "gzip")
    )
    assert (plain.headers["ETag"], packed.headers["ETag"]) == ('"tag"', '"tag.gz"')
    assert (plain.headers["Vary"], packed.headers["Vary"]) == ("Accept-Encoding", "Accept-Encoding")
    for tag in ('"tag"', '"tag.gz"'):
        kept = client.get("/whole?kind=text/csv", headers=GZIP | {"If-None-Match": tag})
        assert (kept.status_code, kept.headers["ETag"]) == (304, tag)


def test_a_signed_in_page_tells_nothing_by_its_size(client):
    page = client.get("/whole?kind=text/html", headers=GZIP | {"Cookie": "session=1"})
    assert "content-encoding" not in page.headers


def test_the_openapi_document_is_small_and_asked_for_again_cheaply(open_http):
    with open_http.stream("GET", "/openapi.json", headers=GZIP) as answer:
        packed = b"".join(answer.iter_raw())
    text = gzip.decompress(packed)
    assert json.loads(text)["openapi"] == "3.1.0"
    assert (len(text) < 900_000, len(packed) < 130_000) == (True, True)
    plain = open_http.get("/openapi.json", headers={"Accept-Encoding": "identity"})
    assert plain.content == text
    for tag in (answer.headers["ETag"], plain.headers["ETag"]):
        assert open_http.get("/openapi.json", headers=GZIP | {"If-None-Match": tag}).status_code == 304
