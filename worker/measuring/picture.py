"""A frame's undistorted picture: its numbers, moved to where a lens without distortion shows them."""

import io
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from radiometry.drawing.chart import WIDEST_PX
from radiometry.frame import Frame
from radiometry.specification.application import PictureApplication
from store.codec import decode_exposure, read_applied
from store.measuring.record import Products
from store.software import read_version
from worker.maps.packet import write_packet
from worker.maps.strips import cut_strips
from worker.maps.tiff import MapFacts, Samples, write_picture
from worker.measuring.task import Task, keep, keep_file

_DARK_PERCENTILE, _BRIGHT_PERCENTILE = 0.5, 99.5
_GAMMA = 1 / 2.2


def measure(task: Task, application: PictureApplication) -> tuple[dict[str, Any], Products]:
    """The camera that was used, and the picture as TIFF and as a preview."""
    header = task.header
    found = application.undistort_frame(_read(task), read_applied(task.calibration))
    task.report(0.7)
    parameters = {
        row["name"]: {name: row[name] for name in ("value", "standard_uncertainty", "unit")}
        for row in task.calibration.result["coefficients"]
        if row["name"] != "rms_px"
    }
    undistorted = {
        "planes": list(found.planes),
        "linear": not header.rendered,
        "height_px": header.height_px,
        "width_px": header.width_px,
        "seen_share": found.seen_share,
        "parameters": parameters,
    }
    description = task.describe(
        quantity=application.quantity,
        unit=application.unit,
        unseen=0,
        black_level_dn=list(header.black_level_dn),
        white_level_dn=list(header.white_level_dn),
        **undistorted,
    )
    facts = MapFacts(
        header=header,
        exposure=decode_exposure(task.frame.exposure) if task.frame.exposure else None,
        software=f"stilb {read_version()}",
        description=description,
        packet=write_packet(header),
    )
    with tempfile.TemporaryDirectory(prefix="stilb-map-") as folder:
        target = Path(folder) / "map.tif"
        write_picture(target, found.samples_dn, facts)
        blobs = task.blobs
        picture = draw_preview(found.samples_dn, linear=not header.rendered)
        products = Products(tif=keep_file(blobs, target), png=keep(blobs, picture))
    return {"undistorted": undistorted, "flags": []}, products


def _read(task: Task) -> Frame:
    """The whole frame, strip by strip: a decoder is asked for no more at once."""
    frames = [
        task.decoders.read_window(task.file, (top, 0, height, task.header.width_px))
        for top, height in cut_strips(task.header)
    ]
    first = frames[0]
    return Frame(
        samples_dn=np.concatenate([frame.samples_dn for frame in frames]),
        row0=0,
        col0=0,
        height_px=first.height_px,
        width_px=first.width_px,
        cfa=first.cfa,
        black_level_dn=first.black_level_dn,
        white_level_dn=first.white_level_dn,
    )


def draw_preview(samples_dn: Samples, *, linear: bool) -> bytes:
    """PNG of 8 bits: every n-th pixel, straight between two percentiles; linear numbers get a tone curve."""
    step = max(1, -(-max(samples_dn.shape[:2]) // WIDEST_PX))
    shown: NDArray[np.float64] = samples_dn[::step, ::step].astype(np.float64)
    low, high = np.percentile(shown, (_DARK_PERCENTILE, _BRIGHT_PERCENTILE))
    share = np.clip((shown - low) / max(high - low, 1.0), 0.0, 1.0)
    pixels = np.round(255 * (share**_GAMMA if linear else share)).astype(np.uint8)
    out = io.BytesIO()
    Image.fromarray(pixels).save(out, "PNG", compress_level=1)
    return out.getvalue()
