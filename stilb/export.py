"""Everything that a calibration or a measurement depends on, in a folder; a repeated export fetches the rest.

certificate.json  certificate.pdf   as they were issued; of a draft as the service derives them
amendment-1.json  amendment-1.pdf   and so on, where there are any
status.json                         how the version stands at the time of the export, and the hashes of these
readings.json     roi.json          the meter readings and regions that went in
panels.json                         the reflectance panels, where there are any
frames/<hash>-<name>                every frame, byte for byte
SHA256SUMS                          for `sha256sum --check` of the frames
record.json       map.tif           of a measurement, in place of the others
"""

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stilb.transport import Call, Transport, address, hash_file, write_whole

CERTIFICATE, READINGS, PANELS, REGIONS = "certificate.json", "readings.json", "panels.json", "roi.json"
STATUS = "status.json"
RECORD, MAP = "record.json", "map.tif"

_SHA256 = re.compile(r"[0-9a-f]{64}")
# What a certificate adds where two frames share a file name.
_TOLD_APART = re.compile(r" \([0-9a-f]{8}\)$")
_LONGEST_NAME = 100
_STATUS = (
    *("id", "method", "version", "state", "valid_from", "valid_to", "superseded_by", "revoked_reason"),
    "certificates",
)


@dataclass(frozen=True, kw_only=True)
class ExportProgress:
    """How far an export is; what lay there already counts as done."""

    filename: str
    files_done: int
    files_total: int
    bytes_done: int
    bytes_total: int


OnExport = Callable[[ExportProgress], None]


def frame_path(frame: Mapping[str, Any]) -> str:
    """Where a frame of a certificate lies in an export: under a name that no file system minds."""
    sha256 = str(frame["sha256"])
    if _SHA256.fullmatch(sha256) is None:
        raise ValueError(f"not a SHA-256: {sha256!r}")
    name = re.sub(r"[^A-Za-z0-9._-]", "_", _TOLD_APART.sub("", str(frame["frame"])))
    stem, dot, extension = name.rpartition(".")
    named = f"{stem[: max(0, _LONGEST_NAME - len(extension))]}{dot}{extension[:_LONGEST_NAME]}"
    return f"frames/{sha256[:12]}-{named.rstrip('.')}"


def name_issued(issued: Mapping[str, Any]) -> str:
    """Return the name of an issued certificate's files in an export, without their endings."""
    return f"amendment-{issued['amendment']}" if issued["amendment"] else "certificate"


def export(transport: Transport, calibration_id: str, folder: Path, on_progress: OnExport | None) -> Path:
    """Fetch it all; a file counts only when its hash is the certificate's."""
    (folder / "frames").mkdir(parents=True, exist_ok=True)
    of_version = address("calibrations", calibration_id)
    content = transport.send(Call(method="GET", path=f"{of_version}/certificate.json")).content
    certificate = json.loads(content)
    frames = certificate["frames"]
    total = {"files_total": len(frames), "bytes_total": sum(frame["size_bytes"] for frame in frames)}
    done = 0
    for number, frame in enumerate(frames, start=1):
        _fetch(
            transport, address("frames", frame["id"], "content"), folder / frame_path(frame), frame["sha256"]
        )
        done += frame["size_bytes"]
        if on_progress is not None:
            on_progress(ExportProgress(filename=frame["frame"], files_done=number, bytes_done=done, **total))
    transport.download(Call(method="GET", path=f"{of_version}/certificate.pdf"), folder / "certificate.pdf")
    status = transport.json(Call(method="GET", path=of_version))
    for issued in status.get("certificates", [])[1:]:
        for form in ("json", "pdf"):
            which = {"amendment": issued["amendment"]}
            call = Call(method="GET", path=f"{of_version}/certificate.{form}", query=which)
            path = folder / f"{name_issued(issued)}.{form}"
            transport.download(call, path, sha256=issued[f"{form}_sha256"])
    _write_json(folder / STATUS, {name: status[name] for name in _STATUS if name in status})
    _write_json(folder / READINGS, certificate["readings"])
    if certificate.get("panels"):
        _write_json(folder / PANELS, certificate["panels"])
    _write_json(folder / REGIONS, certificate["regions"])
    sums = "".join(f"{frame['sha256']}  {frame_path(frame)}\n" for frame in frames)
    write_whole(folder / "SHA256SUMS", sums)
    write_whole(folder / CERTIFICATE, content)  # last: where it lies, the rest lies too
    return folder


def export_measurement(transport: Transport, measurement_id: str, folder: Path) -> Path:
    """Fetch a measurement's record, its frames and its map; begun again, only what is not there yet."""
    (folder / "frames").mkdir(parents=True, exist_ok=True)
    of_measurement = address("measurements", measurement_id)
    content = transport.send(Call(method="GET", path=f"{of_measurement}/{RECORD}")).content
    record = json.loads(content)
    for frame in record["frames"]:
        path = folder / frame_path(frame | {"frame": frame["filename"]})
        _fetch(transport, address("frames", frame["id"], "content"), path, frame["sha256"])
    if "map_sha256" in record:
        _fetch(transport, f"{of_measurement}/{MAP}", folder / MAP, record["map_sha256"])
    write_whole(folder / RECORD, content)  # last, as the certificate
    return folder


def _fetch(transport: Transport, source: str, path: Path, sha256: str) -> None:
    if not path.exists() or hash_file(path) != sha256:
        transport.download(Call(method="GET", path=source), path, sha256=sha256)


def _write_json(path: Path, value: object) -> None:
    write_whole(path, json.dumps(value, indent=1, ensure_ascii=False) + "\n")
