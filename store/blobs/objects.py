"""Blobs in an S3 bucket, with copies on the local disk; whatever speaks S3 will do."""

import fcntl
import os
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from datetime import timedelta
from pathlib import Path
from urllib.parse import urlsplit

import obstore
from obstore.exceptions import BaseError
from obstore.store import S3Store

from store.blobs import proof, spool
from store.settings import read_bucket_secrets


class Cache:
    """A folder of files named by their hash; a file in use is never evicted, whichever process uses it."""

    def __init__(self, folder: Path, limit_bytes: int) -> None:
        self._folder, self._limit_bytes = folder, limit_bytes

    @contextmanager
    def held(self, name: str) -> Iterator[Path | None]:
        """Return the file and keep it from eviction while the context lasts; None if it is not here."""
        path = self._folder / name
        try:
            fd = os.open(path, os.O_RDONLY)
        except FileNotFoundError:
            yield None
            return
        try:
            # A lock, unlike a counter, goes away with a killed process.
            fcntl.flock(fd, fcntl.LOCK_SH)
            evicted = os.fstat(fd).st_nlink == 0
            if not evicted:
                os.utime(path)
            yield None if evicted else path
        finally:
            os.close(fd)

    def add(self, name: str, file: Path) -> None:
        """Take over a finished file of the same filesystem."""
        self._folder.mkdir(parents=True, exist_ok=True)
        file.replace(self._folder / name)

    def evict(self) -> None:
        """Remove the files that were not used for longest until the rest fits, leaving those in use."""
        entries = []
        for entry in os.scandir(self._folder):
            with suppress(FileNotFoundError):
                if entry.is_file():
                    entries.append((entry.stat().st_mtime, entry.stat().st_size, entry.path))
        total = sum(size for _, size, _ in entries)
        for _, size, path in sorted(entries):
            if total <= self._limit_bytes:
                return
            if _removed_unless_held(path):
                total -= size


def _removed_unless_held(path: str) -> bool:
    try:
        fd = os.open(path, os.O_RDONLY)
    except FileNotFoundError:
        return True
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        os.unlink(path)  # noqa: PTH108 (a path from scandir)
    except BlockingIOError:
        return False
    except FileNotFoundError:
        return True
    finally:
        os.close(fd)
    return True


CACHE_BYTES = 8 << 30
_CONNECT_WITHIN_S = 5.0
_CHECK_WITHIN_S = 2.0
_ONE_REQUEST = timedelta(hours=1)
_ASKED_AT_ONCE = 16
_ENDPOINTS = ("AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT_URL", "AWS_ENDPOINT")


class ObjectBlobs(spool.Blobs):
    """Blobs as objects `<prefix>/ab/cd/<sha256>`; keys, region and endpoint come from the AWS_* environment.

    A new blob is spooled to the local disk first: its name is its hash, and S3 can rename nothing.
    """

    def __init__(
        self,
        url: str,
        cache_folder: Path,
        *,
        endpoint: str | None = None,
        cache_bytes: int = CACHE_BYTES,
        retry_for_s: float = 30.0,
        silence_s: float = 15.0,
    ) -> None:
        super().__init__(cache_folder / "tmp")
        self._url = url
        self._store = _s3_store(url, endpoint, retry_for_s=retry_for_s, silence_s=silence_s)
        # Whoever only asks whether it serves waits for no second attempt.
        self._asked = _s3_store(url, endpoint, retry_for_s=0.0, silence_s=min(silence_s, _CHECK_WITHIN_S))
        self._cache = Cache(cache_folder, cache_bytes)

    @contextmanager
    def local_file(self, blob: proof.StoredBlob) -> Iterator[proof.StoredFile]:
        fetched = False
        while True:
            with self._cache.held(spool.checked_name(blob.sha256)) as path:
                if path is not None:
                    # Only now: while it is held, the newcomer is not itself evicted from too small a cache.
                    if fetched:
                        self._cache.evict()
                    with self._copy_doubted(path, blob.sha256):
                        yield proof.StoredFile(path, blob)
                    return
            self._fetch(blob.sha256)
            fetched = True

    def find_absent(self, sizes: Mapping[str, int]) -> set[str]:
        with ThreadPoolExecutor(_ASKED_AT_ONCE, thread_name_prefix="heads") as pool:
            held = pool.map(self._holds, sizes.keys(), sizes.values())
            return {sha256 for sha256, there in zip(sizes, held, strict=True) if not there}

    def check(self) -> None:
        with self._answers():
            obstore.list_with_delimiter(self._asked)

    def _place(self, temporary: Path, stored: proof.StoredBlob) -> None:
        # Also over what is there: whether that is still whole could be told only by fetching all of it. S3
        # shows an object only once all of it has arrived: who reads meanwhile reads one or the other.
        with self._answers():
            obstore.put(self._store, _key(stored.sha256), temporary)

    def _fetch(self, sha256: str) -> None:
        def place(fetched: Path, stored: proof.StoredBlob) -> None:
            if stored.sha256 != sha256:
                raise proof.BlobDamaged(sha256)
            self._cache.add(sha256, fetched)

        with spool.BlobWriter(self._temporary, place) as writer:
            for chunk in self._pieces(sha256):
                writer.write(chunk)
            writer.commit()

    def _pieces(self, sha256: str, *, pace: Callable[[int], object] | None = None) -> Iterator[bytes]:
        with self._found(sha256):
            stream = obstore.get(self._store, _key(sha256)).stream(min_chunk_size=proof.PIECE_BYTES)
            for chunk in stream:
                if pace is not None:
                    pace(len(chunk))
                yield bytes(chunk)

    def _holds(self, sha256: str, size: int) -> bool:
        try:
            with self._found(sha256):
                return bool(obstore.head(self._store, _key(sha256))["size"] == size)
        except proof.BlobMissing:
            return False

    @contextmanager
    def _copy_doubted(self, path: Path, sha256: str) -> Iterator[None]:
        """Remove a copy that a reader found damaged: of the bucket it says nothing, and is fetched again."""
        try:
            yield
        except proof.BlobDamaged as damage:
            if damage.sha256 != sha256:
                raise
            path.unlink(missing_ok=True)
            message = f"the local copy of {sha256} was damaged and is fetched again"
            raise proof.StorageUnavailable(message) from damage

    @contextmanager
    def _found(self, sha256: str) -> Iterator[None]:
        try:
            with self._answers():
                yield
        except proof.StorageUnavailable as error:
            if isinstance(error.__cause__, FileNotFoundError):
                raise proof.BlobMissing(sha256) from error
            raise

    @contextmanager
    def _answers(self) -> Iterator[None]:
        try:
            yield
        except (BaseError, FileNotFoundError) as error:
            said, *_ = str(error).splitlines() or [""]
            raise proof.StorageUnavailable(f"the blob store {self._url} does not serve: {said}") from error


def _key(sha256: str) -> str:
    spool.checked_name(sha256)
    return f"{sha256[:2]}/{sha256[2:4]}/{sha256}"


def _s3_store(url: str, endpoint: str | None, *, retry_for_s: float, silence_s: float) -> S3Store:
    parts = urlsplit(url)
    if parts.scheme != "s3" or not parts.netloc or parts.query or parts.fragment:
        raise ValueError(f"the blob store's address must read s3://bucket/prefix, not {url!r}")
    # The same order in which the AWS clients look; without any of these it is AWS itself.
    endpoint = endpoint or next((os.environ[name] for name in _ENDPOINTS if os.environ.get(name)), None)
    config = read_bucket_secrets()
    if endpoint:
        config["endpoint"] = endpoint
    return S3Store(
        parts.netloc,
        prefix=parts.path.strip("/") or None,
        config=config,
        client_options={
            "allow_http": (endpoint or "").startswith("http://"),
            "connect_timeout": timedelta(seconds=min(_CONNECT_WITHIN_S, silence_s)),
            # Of each read: a large file may take as long as it takes while its bytes keep coming.
            "read_timeout": timedelta(seconds=silence_s),
            "timeout": _ONE_REQUEST,
        },
        retry_config={
            "retry_timeout": timedelta(seconds=retry_for_s),
            **({} if retry_for_s else {"max_retries": 0}),
        },
    )
