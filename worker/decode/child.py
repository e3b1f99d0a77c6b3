"""The decoding process: answers one request at a time, within limits that it sets on itself first."""

import argparse
import errno
import os
import resource
import sys
import threading
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from radiometry.errors import InputRejected
from worker.decode import messages
from worker.decode.libraw import check_version
from worker.decode.reading import Reader, Window
from worker.decode.source import SourceDamagedError

_OPEN_FILES: Final = 32
_LOOK_FOR_PARENT_S: Final = 0.5


def main() -> None:
    arguments = _parse_arguments()
    threading.Thread(target=_die_with, args=(arguments.parent,), daemon=True).start()
    # What libraries print must not get between the answers.
    answers = os.dup(1)
    os.dup2(2, 1)
    _limit_process(arguments.memory_bytes)
    messages.send(answers, {"ready": True, "rawpy": check_version()})
    reader = Reader()
    while True:
        try:
            request, _ = messages.receive(0)
        except messages.BrokenMessageError:
            return
        _limit_cpu(arguments.cpu_seconds)
        answer, body = _answer(reader, request)
        try:
            messages.send(answers, answer, body)
        except BrokenPipeError:
            return


def _parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="worker.decode", description="Decode raw files for a parent process."
    )
    parser.add_argument("--parent", type=int, required=True, help="the process to die with")
    parser.add_argument("--memory-bytes", type=int, required=True)
    parser.add_argument("--cpu-seconds", type=int, required=True)
    return parser.parse_args()


def _die_with(parent: int) -> None:
    """The closed pipe is not enough: a fork of the parent may hold its other end open.

    PR_SET_PDEATHSIG would fire when the thread ends that started this process, not when its process does.
    """
    while os.getppid() == parent:
        time.sleep(_LOOK_FOR_PARENT_S)
    os._exit(0)


def _limit_process(memory_bytes: int) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (memory_bytes, memory_bytes))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
    resource.setrlimit(resource.RLIMIT_NOFILE, (_OPEN_FILES, _OPEN_FILES))


def _limit_cpu(seconds: int) -> None:
    used = resource.getrusage(resource.RUSAGE_SELF)
    _, hard = resource.getrlimit(resource.RLIMIT_CPU)
    allowed = int(used.ru_utime + used.ru_stime) + 1 + seconds
    resource.setrlimit(resource.RLIMIT_CPU, (allowed, hard))


def _read(reader: Reader, request: dict[str, Any]) -> tuple[dict[str, Any], bytes | memoryview]:
    path = Path(request["path"])
    digests = bytes.fromhex(request["digests"]) if "digests" in request else None
    match request["do"]:
        case "read_header":
            return {"header": asdict(reader.read_header(path, digests))}, b""
        case "read_window":
            frame = reader.read_window(path, Window(*request["window"]), digests)
            told = {name: value for name, value in vars(frame).items() if name != "samples_dn"}
            return {"frame": told}, frame.samples_dn.data
        case _:
            preview, proof = reader.inspect(path, request["longest_side_px"], digests)
            return {"proof": asdict(proof)}, preview


def _answer(reader: Reader, request: dict[str, Any]) -> tuple[dict[str, Any], bytes | memoryview]:
    try:
        return _read(reader, request)
    except InputRejected as refusal:
        return {"refused": {"code": str(refusal.code), "message": refusal.message}}, b""
    except FileNotFoundError:
        return {"missing": True}, b""
    except SourceDamagedError:
        return {"damaged": True}, b""
    except Exception as error:  # noqa: BLE001  the last line before a hostile file becomes our failure
        if isinstance(error, MemoryError) or getattr(error, "errno", None) == errno.ENOMEM:
            return {"failed": "it needs more memory than is allowed"}, b""
        print(f"{request.get('do')}: {error!r}", file=sys.stderr)  # noqa: T201
        return {"failed": type(error).__name__}, b""
