"""The promises that every blob store makes, held by both: the folder and the bucket."""

import hashlib
import os
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from pathlib import Path

import pytest

from store.blobs import (
    BlobDamaged,
    BlobMissing,
    LocalBlobs,
    StorageUnavailable,
    StoredBlob,
    blobs_from_url,
    prove_file,
)
from store.blobs.objects import ObjectBlobs
from store.blobs.proof import PIECE_BYTES
from tests.support.blobs import files, put, spoil
from tests.support.s3 import s3_bucket, s3_endpoint  # noqa: F401 (fixtures)

ABSENT = "0" * 64


@pytest.fixture(params=["folder", "bucket"])
def blobs(request, tmp_path):
    if request.param == "folder":
        return LocalBlobs(tmp_path / "blobs")
    request.getfixturevalue("s3_bucket")
    return ObjectBlobs("s3://raw/pre/fix", tmp_path / "cache", retry_for_s=1)


# More than one part of a multipart upload, and not a whole number of read pieces.
@pytest.mark.parametrize("size", [0, 1, 12_345_678])
def test_bytes_come_back_as_they_were_sent(blobs, size):
    data = os.urandom(size)
    stored = put(blobs, data[: size // 3], data[size // 3 :])
    assert (stored.sha256, stored.size_bytes) == (hashlib.sha256(data).hexdigest(), size)
    assert b"".join(blobs.open(stored)) == data
    assert blobs.prove(stored.sha256, int) == stored
    assert blobs.find_absent({stored.sha256: size}) == set()
    assert blobs.find_absent({stored.sha256: size + 1, ABSENT: 0}) == {stored.sha256, ABSENT}


def test_a_real_file_is_given_to_readers_that_map(blobs):
    stored = put(blobs, b"raw frame")
    for _ in range(2):
        with blobs.local_file(stored) as file:
            assert file.path.read_bytes() == b"raw frame"
            assert file.blob == stored
            prove_file(file)


def test_what_was_never_stored_is_missing(blobs):
    absent = StoredBlob(ABSENT, 1, b"x" * 16)
    put(blobs, b"another")
    with pytest.raises(BlobMissing, match=ABSENT):
        blobs.prove(ABSENT, int)
    with pytest.raises(BlobMissing, match=ABSENT):
        list(blobs.open(absent))
    with pytest.raises(BlobMissing, match=ABSENT), blobs.local_file(absent):
        pass


@pytest.mark.parametrize("change", ["flip", "cut", "grow", "empty"])
def test_bytes_that_changed_where_they_are_kept_are_not_handed_out(blobs, tmp_path, change):
    data = os.urandom(3 * PIECE_BYTES + 9)
    stored = put(blobs, data)
    wrong = {
        "flip": data[: 2 * PIECE_BYTES] + bytes(20_000) + data[2 * PIECE_BYTES + 20_000 :],
        "cut": data[:-1],
        "grow": data + b"x",
        "empty": b"",
    }[change]
    spoil(blobs, tmp_path, stored.sha256, wrong)
    got = b""
    with pytest.raises(BlobDamaged, match=stored.sha256):  # noqa: PT012 (what came before it counts)
        for piece in blobs.open(stored):
            got += piece
    assert data.startswith(got)
    assert len(got) == (0 if change == "empty" else PIECE_BYTES * (2 if change == "flip" else 3))
    with pytest.raises(BlobDamaged), blobs.local_file(stored) as file:
        prove_file(file)
    with pytest.raises(BlobDamaged):
        blobs.prove(stored.sha256, int)
    assert blobs.find_absent({stored.sha256: len(data)}) == (set() if change == "flip" else {stored.sha256})
    # the same upload is the cure
    assert put(blobs, data) == stored
    assert b"".join(blobs.open(stored)) == data


@pytest.mark.parametrize("name", ["../../etc/passwd", "A" * 64, "0" * 63, "0" * 64 + "\n"])
def test_a_name_that_is_no_hash_is_refused(blobs, name):
    with pytest.raises(ValueError, match="SHA-256"):
        blobs.find_absent({name: 1})
    with pytest.raises(ValueError, match="SHA-256"), blobs.local_file(StoredBlob(name, 1, b"")):
        pass


def test_a_write_that_is_abandoned_or_fails_on_the_way_leaves_nothing(blobs, tmp_path):
    for failure in (None, ConnectionResetError):
        with pytest.raises(failure) if failure else nullcontext(), blobs.writer() as writer:
            writer.write(b"half a frame")
            if failure:
                raise failure
        assert files(tmp_path) == []
    sha256 = hashlib.sha256(b"half a frame").hexdigest()
    assert blobs.find_absent({sha256: 12}) == {sha256}


def test_the_same_bytes_from_twenty_threads_are_one_blob(blobs, tmp_path):
    with ThreadPoolExecutor(20) as pool:
        stored = set(pool.map(lambda _: put(blobs, b"x" * 200_000, b"y"), range(20)))
    assert len(stored) == 1
    assert b"".join(blobs.open(stored.pop())) == b"x" * 200_000 + b"y"
    assert len(files(tmp_path)) == (1 if isinstance(blobs, LocalBlobs) else 0)


def test_a_store_that_takes_writes_is_fit(blobs, tmp_path):
    blobs.check()
    assert files(tmp_path) == []


@pytest.mark.usefixtures("s3_bucket")
def test_the_setting_names_the_store(tmp_path):
    stored = put(blobs_from_url("", tmp_path), b"a")
    assert files(tmp_path / "blobs")[0].relative_to(tmp_path / "blobs") == Path(
        stored.sha256[:2], stored.sha256[2:4], stored.sha256
    )
    put(blobs_from_url(str(tmp_path / "else"), tmp_path), b"a")
    put(blobs_from_url((tmp_path / "el se").as_uri(), tmp_path), b"a")
    assert len(files(tmp_path / "else")) == len(files(tmp_path / "el se")) == 1
    assert isinstance(blobs_from_url("s3://raw/a", tmp_path), ObjectBlobs)
    with pytest.raises(ValueError, match="not at gs://"):
        blobs_from_url("gs://raw", tmp_path)
    with pytest.raises(ValueError, match="s3://bucket/prefix"):
        blobs_from_url("s3://raw?region=x", tmp_path)


@pytest.mark.usefixtures("s3_bucket")
def test_an_absent_bucket_and_a_server_that_does_not_answer_are_unavailable(tmp_path):
    absent = ObjectBlobs("s3://elsewhere", tmp_path, retry_for_s=1)
    silent = ObjectBlobs("s3://raw", tmp_path, endpoint="http://127.0.0.1:9", retry_for_s=0.1)
    with pytest.raises(StorageUnavailable, match="s3://elsewhere"):
        absent.check()
    with pytest.raises(StorageUnavailable, match="s3://elsewhere"):
        put(absent, b"a")
    with pytest.raises(StorageUnavailable):
        silent.find_absent({ABSENT: 1})
    with pytest.raises(StorageUnavailable):
        put(silent, b"a")
    assert files(tmp_path) == []
