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
    place, through = f"s3://{s3_bucket}", f"http://{proxy.address}"
    return ObjectBlobs(place, tmp_path, endpoint=through, retry_for_s=1.0, silence_s=SILENCE_S)


def test_whatever_is_asked_of_a_silent_store_ends(blobs, proxy):
    stored = put(blobs, b"before")
    asked = (blobs.check, lambda: b"".join(blobs.open(stored)), lambda: put(blobs, b"meanwhile"))
    with proxy.being("silent"):
        began = time.monotonic()
        for ask in asked:
            with pytest.raises(StorageUnavailable):
                ask()
        assert time.monotonic() - began < 120
    assert [ask() for ask in asked[:2]] == [None, b"before"]
    put(blobs, b"meanwhile")


def test_an_answer_that_keeps_coming_may_outlast_the_limit(blobs, proxy):
    data = bytes(1 << 20)
    stored = put(blobs, data)
    with proxy.being("slow"):
        began = time.monotonic()
        assert b"".join(blobs.open(stored)) == data
        assert time.monotonic() - began > 2 * SILENCE_S
