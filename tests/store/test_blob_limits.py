"""A file store that swallows packets: nobody waits for ever, and it is used again when it is back."""

import time

import pytest

from store.blobs import StorageUnavailable
from store.blobs.objects import ObjectBlobs
from tests.support.blobs import put
from tests.support.proxy import Proxy

SILENCE_S = 1.5


@pytest.fixture
def proxy(s3_endpoint):
    host, port = s3_endpoint.removeprefix("http://").split(":")
    with Proxy((host, int(port))) as proxy:
        yield proxy


@pytest.fixture
def blobs(proxy, s3_bucket, tmp_path):
    return ObjectBlobs(
        f"s3://{s3_bucket}",
        tmp_path,
        endpoint=f"http://{proxy.address}",
        retry_for_s=1.0,
        silence_s=SILENCE_S,
    )


def test_whether_it_serves_is_known_soon(blobs, proxy):
    blobs.check()
    with proxy.being("silent"):
        began = time.monotonic()
        with pytest.raises(StorageUnavailable):
            blobs.check()
        assert time.monotonic() - began < 60
    blobs.check()


def test_reading_and_writing_end(blobs, proxy):
    stored = put(blobs, b"before")
    with proxy.being("silent"):
        began = time.monotonic()
        with pytest.raises(StorageUnavailable):
            b"".join(blobs.open(stored))
        with pytest.raises(StorageUnavailable):
            put(blobs, b"meanwhile")
        assert time.monotonic() - began < 120
    assert b"".join(blobs.open(stored)) == b"before"
    put(blobs, b"meanwhile")


def test_an_answer_that_keeps_coming_may_outlast_the_limit(blobs, proxy):
    data = bytes(1 << 20)
    stored = put(blobs, data)
    with proxy.being("slow"):
        began = time.monotonic()
        assert b"".join(blobs.open(stored)) == data
        assert time.monotonic() - began > 2 * SILENCE_S
