"""Recomputing of a rig: the versions of its cameras from their frames, then the orientation from these."""

import hashlib
import json
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from radiometry.findings import InputRejected
from radiometry.specification.exports import RigMember
from store.codec import drop_absent, encode
from store.queries.calibration_record import state_orientation
from store.queries.fleet import SPEC
from verify.checks import check
from verify.compare import Row, compare, take_stated
from verify.data import Node, Unusable, is_address, open_export, read_folder
from verify.recompute import OnFrame, Recomputed, recompute
from worker.decode.pool import DecoderPool


def verify_rig(
    certificate: Node, place: str, key: str, decoders: DecoderPool, on_frame: OnFrame
) -> list[Row]:
    """Recompute the certificate of each camera, and orient the rig from the results."""
    rows, members = [], []
    for camera in certificate["cameras"]:
        serial = camera["item"]["serial"]
        with ExitStack() as stack:
            folder = place if is_address(place) else str(_find_export(Path(place), camera))
            data = read_folder(stack.enter_context(open_export(folder, key, camera["calibration_id"])))
            own = data.certificate
            found = recompute(own, data, decoders, on_frame)
            rows += [replace(row, group=f"{serial}: {row.group}") for row in check(own, data, found)]
        stated = {name: own[name] for name in ("item", "calibration_id", "version", "content_sha256")}
        rows += compare("cameras", camera, stated | {"certificate": own["number"], "state": camera["state"]})
        if found.fit is None:
            return rows
        members.append(_make_member(certificate, serial, found))
    return [*rows, *_compare(certificate, members)]


def _find_export(folder: Path, camera: Node) -> Path:
    """Return the export of a camera's version, wherever it lies in the folder."""
    for path in sorted(folder.rglob("certificate.json")):
        if json.loads(path.read_bytes()).get("calibration_id") == camera["calibration_id"]:
            return path.parent
    raise Unusable(f"{folder} has no export of version {camera['calibration_id']}: {camera['certificate']}")


def _make_member(certificate: Node, serial: str, found: Recomputed) -> RigMember:
    """Return a camera with the triggers that the certificate states: scenes may have been corrected since."""
    triggers = {
        point["frame"]: point["trigger"]
        for point in certificate["orientation"]["points"]
        if point["camera"] == serial and point["trigger"]
    }
    rows = {frame.row.frame: frame.row for frame in found.frames if frame.row}
    return RigMember(
        serial=serial,
        fitted=found.fit,
        params=found.params,
        rows=tuple(replace(rows[name], scene=triggers.get(name, rows[name].scene)) for name in sorted(rows)),
    )


def _compare(certificate: Node, members: Sequence[RigMember]) -> Iterator[Row]:
    try:
        orientation = SPEC.orient(members)
    except InputRejected as refusal:
        yield Row("rig", "oriented", "yes", refusal.message)
        return
    found = drop_absent(encode(orientation))
    yield from compare("orientation", certificate["orientation"], found)
    yield from compare(
        "rig coefficients", certificate["coefficients"], state_orientation(orientation), "coefficients"
    )
    content = {
        "cameras": [camera["content_sha256"] for camera in certificate["cameras"]],
        "orientation": take_stated(certificate["orientation"], found),
    }
    sha256 = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
    yield Row("content hash", "content SHA-256", certificate["content_sha256"], sha256)
