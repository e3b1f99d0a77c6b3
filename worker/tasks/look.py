"""A region of one frame looked at while it is drawn: the job's result is all that is kept."""

from dataclasses import asdict
from typing import Any

from radiometry.findings import InputRejected, files
from radiometry.frame import Frame
from radiometry.frame.roi import Polygon, Window, bounding_window, mask
from radiometry.frame.statistics import compute_statistics, count_histogram, map_clipping
from store.codec import decode_header, encode_statistics
from store.jobs import Claim
from store.tables import FrameRow
from worker.context import Context
from worker.decode.pool import DecoderCrashed
from worker.tasks.outcome import Outcome


def look(context: Context, claim: Claim) -> Outcome:
    """Read the region's window and describe it; no extraction is stored, for nobody has set this region."""
    with context.database.reading() as session:
        frame = session.get_one(FrameRow, claim.subject_id)
    header = decode_header(frame.header or {})
    polygon = Polygon.from_points(claim.parameters["polygon"])
    window = bounding_window(polygon, height_px=header.height_px, width_px=header.width_px)
    pixels = read_pixels(context, frame, (window.row0, window.col0, window.height, window.width))
    result = {
        "frame_id": frame.id,
        "polygon": claim.parameters["polygon"],
        **_describe(pixels, polygon, window),
    }
    return Outcome(store=lambda _session: result)


def read_pixels(context: Context, frame: FrameRow, window: tuple[int, int, int, int]) -> Frame:
    """Read a window (row0, col0, height, width) of a frame; only a whole file is blamed for a crash."""
    try:
        with context.files.local(frame.sha256) as file:
            return context.decoders.read_window(file, window)
    except DecoderCrashed as crash:
        context.files.prove(frame.sha256)
        raise InputRejected(files.DECODER_CRASHED, crash.message) from crash


def _describe(pixels: Frame, polygon: Polygon, window: Window) -> dict[str, Any]:
    inside = mask(polygon, window)
    return {
        "statistics": [encode_statistics(row) for row in compute_statistics(pixels, inside)],
        "histogram": asdict(count_histogram(pixels, inside)),
        "clipping": asdict(map_clipping(pixels, inside)),
    }
