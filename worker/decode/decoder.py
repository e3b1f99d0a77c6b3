"""One decoding process, started anew whenever it has died; for one caller at a time."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, TypeVar

from radiometry.frame import Frame, FrameHeader
from radiometry.proof import Proof
from store.blobs import BlobDamaged, StoredFile
from worker.decode import answers, messages
from worker.decode.settings import DecoderLimits

_ROOT: Final = Path(__file__).resolve().parents[2]
_START_SECONDS: Final = 60.0
_PREVIEW_BYTES: Final = 64 << 20
PREVIEW_SIDE_PX: Final = 1600
# Linux's limit for a pipe without privileges: fewer changes of process on the way.
_PIPE_BYTES: Final = 1 << 20

_T = TypeVar("_T")

Readable = Path | StoredFile
"""A file to decode: a stored one is proven where it is read, any other is taken as it is."""


class DecoderCrashed(Exception):  # noqa: N818  it says what happened
    """The decoding process ended while it read this file: the file is hostile, or a decoder is wrong."""

    def __init__(self, stage: str, reason: str) -> None:
        message = f"The decoder failed while it read this file ({stage}: {reason}). The file may be damaged."
        super().__init__(message)
        self.stage = stage
        self.reason = reason
        self.message = message


class DecoderUnavailable(Exception):  # noqa: N818  it says what happened
    """The decoding process does not start: an installation at fault, not a file."""


class Decoder:
    """Not thread-safe: the pool lends each to one caller at a time."""

    def __init__(self, decoder_limits: DecoderLimits) -> None:
        self._limits = decoder_limits
        self._process: subprocess.Popen[bytes] | None = None
        self.last_path: Path | None = None

    @property
    def pid(self) -> int | None:
        return self._process.pid if self._process else None

    def read_header(self, file: Readable) -> FrameHeader:
        answer, _ = self._ask(file, {"do": "read_header"}, 0)
        return self._checked("read_header", lambda: answers.check_header(answer))

    def read_window(self, file: Readable, window: tuple[int, int, int, int]) -> Frame:
        _, _, height, width = window
        most = min(max(0, height) * max(0, width) * 6, messages.MAX_BODY_BYTES)
        answer, body = self._ask(file, {"do": "read_window", "window": list(window)}, most)
        return self._checked("read_window", lambda: answers.check_frame(answer, body, window))

    def inspect(self, file: Readable, longest_side_px: int = PREVIEW_SIDE_PX) -> tuple[bytes, Proof]:
        request = {"do": "inspect", "longest_side_px": longest_side_px}
        answer, body = self._ask(file, request, _PREVIEW_BYTES)
        return self._checked("inspect", lambda: (answers.check_preview(body), answers.check_proof(answer)))

    def close(self) -> None:
        """End the process; the next request starts a new one."""
        process, self._process, self.last_path = self._process, None, None
        if process is None:
            return
        process.kill()
        process.wait()
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):
                    pipe.close()

    def abandon(self) -> None:
        """Forget a process that belongs to the parent of this one: after a fork it is not ours to end."""
        self._process = None

    def _ask(
        self, file: Readable, request: dict[str, Any], max_body_bytes: int
    ) -> tuple[dict[str, Any], bytearray]:
        stage = str(request["do"])
        path = path_of(file)
        request = {**request, "path": str(path.absolute())}
        if isinstance(file, StoredFile):
            request["digests"] = file.blob.digests.hex()
        process = self._deliver(request)
        deadline = time.monotonic() + self._limits.wall_seconds
        try:
            answer, body = messages.receive(_out(process), deadline=deadline, max_body_bytes=max_body_bytes)
        except TimeoutError:
            self.close()
            seconds = self._limits.wall_seconds
            raise DecoderCrashed(stage, f"it took longer than {seconds:g} s") from None
        except messages.BrokenMessageError as error:
            raise DecoderCrashed(stage, self._autopsy(str(error))) from error
        self.last_path = path
        return self._sorted(answer, stage, file), body

    def _sorted(self, answer: dict[str, Any], stage: str, file: Readable) -> dict[str, Any]:
        """The answer if it is one; a refusal or a failure is raised."""
        if "refused" in answer:
            raise self._checked(stage, lambda: answers.check_refusal(answer))
        if "missing" in answer:
            raise FileNotFoundError(path_of(file))
        if "damaged" in answer and isinstance(file, StoredFile):
            raise BlobDamaged(file.blob.sha256)
        if "failed" in answer:
            self.close()
            raise DecoderCrashed(stage, str(answer["failed"])[:200])
        return answer

    def _checked(self, stage: str, check: Callable[[], _T]) -> _T:
        """A process that answers nonsense is not asked again."""
        try:
            return check()
        except messages.BrokenMessageError as error:
            self.close()
            raise DecoderCrashed(stage, str(error)) from error

    def _deliver(self, request: dict[str, Any]) -> "subprocess.Popen[bytes]":
        """A process may have died while it was idle; that is no fault of this request."""
        process = self._running()
        try:
            messages.send(_into(process), request)
        except BrokenPipeError:
            self.close()
            process = self._running()
            messages.send(_into(process), request)
        return process

    def _running(self) -> "subprocess.Popen[bytes]":
        if self._process is not None and self._process.poll() is None:
            return self._process
        self.close()
        self._process = self._start()
        return self._process

    def _start(self) -> "subprocess.Popen[bytes]":
        bounds = self._limits
        process = subprocess.Popen(  # noqa: S603  our own interpreter, our own module
            [
                *(sys.executable, "-s", "-P", "-m", "worker.decode"),
                *("--parent", str(os.getpid())),
                *("--memory-bytes", str(bounds.memory_bytes)),
                *("--cpu-seconds", str(bounds.cpu_seconds)),
            ],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            bufsize=0,
            pipesize=_PIPE_BYTES,
            env=_environment(),
            start_new_session=True,  # Ctrl-C in a terminal is for the parent alone
        )
        try:
            ready, _ = messages.receive(_out(process), deadline=time.monotonic() + _START_SECONDS)
        except (TimeoutError, messages.BrokenMessageError) as error:
            self._process = process
            raise DecoderUnavailable(
                f"The decoding process does not start: {self._autopsy(str(error))}."
            ) from error
        if ready.get("ready") is not True:
            self._process = process
            self.close()
            raise DecoderUnavailable("The decoding process does not keep to the protocol.")
        return process

    def _autopsy(self, fallback: str) -> str:
        """How the process ended, once its pipe is closed."""
        process = self._process
        if process is None:
            return fallback
        try:
            status = process.wait(timeout=1.0)
        except subprocess.TimeoutExpired:
            status = 0
        self.close()
        return f"ended by {signal.Signals(-status).name}" if status < 0 else fallback


def path_of(file: Readable) -> Path:
    return file.path if isinstance(file, StoredFile) else file


def _environment() -> dict[str, str]:
    """Nothing that the service knows: no settings, no credentials. One thread per library."""
    kept = {name: os.environ[name] for name in ("PATH", "LANG") if name in os.environ}
    return {
        **kept,
        "PYTHONPATH": str(_ROOT),
        "PYTHONDONTWRITEBYTECODE": "1",
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }


def _into(process: "subprocess.Popen[bytes]") -> int:
    assert process.stdin is not None  # noqa: S101  it was started with a pipe
    return process.stdin.fileno()


def _out(process: "subprocess.Popen[bytes]") -> int:
    assert process.stdout is not None  # noqa: S101  it was started with a pipe
    return process.stdout.fileno()
