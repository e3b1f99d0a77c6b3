"""Recomputing of a measurement: its frames measured again with the worker's code, and its map compared."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from math import inf
from pathlib import Path

import numpy as np
import tifffile

from radiometry.findings import InputRejected
from radiometry.frame.exposure import Camera, SuppliedExposure, accept_frame
from stilb import export, transport
from store import codec, software
from store.blobs import LocalBlobs
from store.measuring.record import Products, hash_content
from store.tables import Calibration, FrameRow
from verify.compare import Row, compare, take_stated
from verify.data import Node, find_frame
from worker.decode.pool import DecoderPool, Readable
from worker.maps.tiff import ROUNDING_REL
from worker.measuring.task import Task
from worker.tasks.measure import measure_frame

_PIXEL_REL = 2.1 * ROUNDING_REL  # where a last digit decides, its rounding in the file goes either way


def verify_measurement(record: Node, folder: Path, decoders: DecoderPool) -> list[Row]:
    """Measure again, and compare hashes, exposures, results and every pixel of the map."""
    rows = [Row("software", "measurer", record["software"]["measurer"], software.MEASURER)]
    paths = {
        frame["id"]: find_frame(folder, frame | {"frame": frame["filename"]}) for frame in record["frames"]
    }
    found: dict[str, FrameRow] = {}
    for frame in record["frames"]:
        path, name = paths[frame["id"]], frame["filename"]
        sha256 = transport.hash_file(path) if path.exists() else "the file is missing"
        rows.append(Row("frame files", f"{name} SHA-256", frame["sha256"], sha256))
        if path.exists():
            found[frame["id"]] = _read(frame, path, decoders)
            exposure = found[frame["id"]].exposure
            rows += compare("exposures", frame.get("exposure"), exposure, name)
            found[frame["id"]].exposure = take_stated(frame.get("exposure"), exposure)
    if len(found) < len(paths):
        return rows
    names = ("id", "method", "version", "content_sha256", "parameters", "inputs", "result")
    calibration = Calibration(**{name: record["calibration"][name] for name in names})
    first = found[record["frames"][0]["id"]]

    @contextmanager
    def lend(frame_id: str) -> Iterator[tuple[FrameRow, Readable]]:
        yield found[frame_id], paths[frame_id]

    with tempfile.TemporaryDirectory(prefix="stilb-verify-") as scratch:
        blobs = LocalBlobs(Path(scratch))
        task = Task(
            decoders=decoders,
            blobs=blobs,
            lend=lend,
            frame=first,
            file=paths[first.id],
            calibration=calibration,
            parameters=record["parameters"],
            report=lambda _share: None,
        )
        try:
            with decoders.hold(paths[first.id]):
                measured, products = measure_frame(task)
        except InputRejected as refusal:
            return [*rows, Row("result", "measured", "yes", refusal.message)]
        stated = {name: value for name, value in record["result"].items() if name != "why"}
        rows += compare("result", stated, measured)
        if products is not None:
            rows += _compare_maps(folder / export.MAP, blobs, products)
    content = hash_content(first, calibration, record["parameters"])
    return [*rows, Row("content hash", "content SHA-256", record["content_sha256"], content)]


def _read(frame: Node, path: Path, decoders: DecoderPool) -> FrameRow:
    with decoders.hold(path):
        header = decoders.read_header(path)
    camera = Camera(make=header.make or "", model=header.model or "", serial=header.serial or "")
    supplied = SuppliedExposure(**frame.get("supplied") or {})
    exposure = accept_frame(header, role=frame["role"], supplied=supplied, camera=camera).exposure
    return FrameRow(
        id=frame["id"],
        filename=frame["filename"],
        sha256=transport.hash_file(path),
        role=frame["role"],
        header=codec.encode(header),
        exposure=codec.encode(exposure) if exposure else None,
    )


def _compare_maps(stated: Path, blobs: LocalBlobs, products: Products) -> Iterator[Row]:
    if not stated.exists():
        yield Row("map", export.MAP, "is there", "is missing")
        return
    with blobs.local_file(products.tif) as file:
        theirs, ours = tifffile.imread(stated), tifffile.imread(file.path)
    yield Row("map", "shape", list(theirs.shape), list(ours.shape))
    if theirs.shape != ours.shape:
        return
    step = _PIXEL_REL * np.abs(theirs) if theirs.dtype.kind == "f" else 1
    same = (theirs == ours) | (np.isnan(theirs) & np.isnan(ours) if theirs.dtype.kind == "f" else False)
    near = same | (np.abs(ours.astype(np.float64) - theirs) <= step)
    total = int(theirs.size)
    if near.all() and not same.all():
        # pixels of less precision than the numbers: as rounding, whatever their last digit is worth
        share = float(np.count_nonzero(same)) / total
        yield Row("map", "pixels to the last bit", 1.0, share, inf)
        return
    yield Row("map", "pixels", total, int(np.count_nonzero(near)))
