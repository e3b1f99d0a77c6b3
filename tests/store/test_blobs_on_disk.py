"""A folder of blobs on a full disk, under a killed process, with a spoilt file; and the cache of a bucket."""

import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from store.blobs import LocalBlobs, StorageFull, StorageUnavailable, StoredBlob, prove_file
from store.blobs.objects import ObjectBlobs
from tests.support.blobs import files, put
from tests.support.disks import small_disk
from tests.support.s3 import s3_bucket, s3_endpoint  # noqa: F401 (fixtures)

MIB = 1 << 20
WRITE_UNTIL_KILLED = """
import sys, time
from pathlib import Path
from store.blobs import LocalBlobs
with LocalBlobs(Path(sys.argv[1])).writer() as writer:
    writer.write(b"half a frame" * 100_000)
    print("written", flush=True)
    time.sleep(60)
"""


def test_a_second_copy_does_not_replace_the_first_but_cures_what_the_disk_spoilt(tmp_path):
    blobs = LocalBlobs(tmp_path)
    stored = put(blobs, b"kept")
    (path,) = files(tmp_path)
    before = path.stat()
    assert before.st_mode & 0o777 == 0o440
    put(LocalBlobs(tmp_path), b"kept")
    assert (path.stat().st_ino, path.stat().st_mtime_ns) == (before.st_ino, before.st_mtime_ns)
    path.chmod(0o600)
    path.write_bytes(b"kep\0")
    put(blobs, b"kept")
    assert b"".join(blobs.open(stored)) == b"kept"


def test_a_file_size_limit_is_a_full_storage(tmp_path):
    def write() -> None:
        with LocalBlobs(tmp_path).writer() as writer:
            for _ in range(8):
                writer.write(b"x" * (MIB // 2))

    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (MIB, hard))
    try:
        with pytest.raises(StorageFull, match=r"no room left .*File too large"):
            write()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert files(tmp_path) == []


def test_a_full_disk_is_a_full_storage(tmp_path):
    with small_disk(tmp_path, megabytes=1) as disk:
        blobs = LocalBlobs(disk)
        with pytest.raises(StorageFull, match=r"no room left .*No space left"):
            put(blobs, b"x" * (3 * MIB // 4), b"y" * MIB)
        assert files(disk) == []
        put(blobs, b"x" * (MIB // 2))


def test_a_folder_that_cannot_be_written_is_unavailable(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(StorageUnavailable, match="cannot be written below"):
        LocalBlobs(tmp_path / "file").check()


def test_a_killed_process_leaves_no_blob_and_its_remains_are_swept(tmp_path):
    blobs = LocalBlobs(tmp_path)
    command = [sys.executable, "-c", WRITE_UNTIL_KILLED, str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        assert process.stdout
        assert process.stdout.readline() == b"written\n"
        process.send_signal(signal.SIGKILL)
    (left,) = files(tmp_path)
    assert left.parent.name == "tmp"
    assert blobs.sweep_temporary(older_than_s=3600) == 0
    os.utime(left, times=(time.time() - 3601,) * 2)
    assert blobs.sweep_temporary(older_than_s=3600) == 1
    assert files(tmp_path) == []


@pytest.fixture
def cached(s3_bucket, tmp_path):  # noqa: F811
    return ObjectBlobs(f"s3://{s3_bucket}", tmp_path / "cache", cache_bytes=3 * MIB, retry_for_s=1)


def names(tmp_path: Path) -> set[str]:
    return {path.name for path in files(tmp_path / "cache")}


def use(cached: ObjectBlobs, blob: StoredBlob) -> None:
    with cached.local_file(blob) as file:
        assert file.path.stat().st_size == MIB


def test_the_cache_forgets_what_was_not_used_for_longest(cached, tmp_path):
    a, b, c, d = (put(cached, bytes([letter]) * MIB) for letter in b"abcd")
    for blob in (a, b, c, a, d):
        use(cached, blob)
    assert names(tmp_path) == {a.sha256, c.sha256, d.sha256}


def test_the_cache_keeps_what_is_in_use(cached, tmp_path):
    a, b, c, d = (put(cached, bytes([letter]) * MIB) for letter in b"abcd")
    with cached.local_file(a) as file:
        for blob in (b, c, d):
            use(cached, blob)
        assert file.path.read_bytes() == b"a" * MIB
        assert names(tmp_path) == {a.sha256, c.sha256, d.sha256}


def test_a_blob_larger_than_the_cache_is_still_served(cached, tmp_path):
    large = put(cached, b"x" * (4 * MIB))
    with cached.local_file(large) as file:
        assert file.path.stat().st_size == 4 * MIB
    use(cached, put(cached, b"a" * MIB))
    assert large.sha256 not in names(tmp_path)


def test_a_damaged_copy_is_fetched_anew(cached, tmp_path):
    blob = put(cached, b"a" * MIB)
    use(cached, blob)
    (copy,) = files(tmp_path / "cache")
    copy.chmod(0o600)
    copy.write_bytes(b"a" * (MIB - 1) + b"b")
    with pytest.raises(StorageUnavailable, match="fetched again"), cached.local_file(blob) as file:
        prove_file(file)
    with cached.local_file(blob) as file:
        prove_file(file)


def test_a_folder_that_is_not_there_is_no_loss_of_its_blobs(tmp_path):
    blobs = LocalBlobs(tmp_path / "blobs")
    stored = put(blobs, b"kept")
    (tmp_path / "blobs").rename(tmp_path / "away")
    with pytest.raises(StorageUnavailable, match="is not there"):
        list(blobs.open(stored))
    with pytest.raises(StorageUnavailable, match="is not there"):
        blobs.find_absent({stored.sha256: 4})
