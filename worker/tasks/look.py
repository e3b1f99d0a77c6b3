"""A part of one frame for whoever looks at it: a region while it is drawn, or a picture of its pixels."""

import io
from dataclasses import asdict
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from sqlalchemy.orm import Session

from radiometry.frame import Frame, roi, statistics
from store import codec, jobs
from store.queries.campaigns import keep_crop, say_asked
from store.tables import Crop, FrameRow, new_id
from worker.context import Context, Outcome


def look(context: Context, claim: jobs.Claim) -> Outcome:
    """Read the region's window and describe it; no extraction is stored, for nobody has set this region."""
    with context.database.reading() as session:
        frame = session.get_one(FrameRow, claim.subject_id)
    header = codec.decode_header(frame.header or {})
    polygon = roi.Polygon.from_points(claim.parameters["polygon"])
    window = roi.bounding_window(polygon, height_px=header.height_px, width_px=header.width_px)
    with context.lend(frame.sha256) as file:
        part = (window.row0, window.col0, window.height, window.width)
        pixels = context.decoders.read_window(file, part)
    inside = roi.mask(polygon, window)
    result = {
        "frame_id": frame.id,
        "polygon": claim.parameters["polygon"],
        "statistics": [asdict(row) for row in statistics.compute_statistics(pixels, inside)],
        "histogram": asdict(statistics.count_histogram(pixels, inside)),
        "clipping": asdict(statistics.map_clipping(pixels, inside)),
    }
    return Outcome(store=lambda _session: result)


_GAMMA: Final = 1 / 2.2
_PERCENTILES: Final = (0.1, 99.9)
_GREYS: Final = 255  # grey levels; the colour of clipped pixels is behind the last of them
_CLIPPED: Final = (230, 30, 45)


def crop(context: Context, claim: jobs.Claim) -> Outcome:
    """Draw the window that a job names, and keep the picture while it is among the newest."""
    with context.database.reading() as session:
        frame = session.get_one(FrameRow, claim.subject_id)
    row0, col0, height, width = window = tuple(claim.parameters["window"])
    low_dn, high_dn = claim.parameters["low_dn"], claim.parameters["high_dn"]
    asked = say_asked(window, low_dn, high_dn)
    with context.lend(frame.sha256) as file:
        pixels = context.decoders.read_window(file, (row0, col0, height, width))
    clipped = statistics.find_clipped(pixels, np.ones((height, width), np.bool_))
    dark, bright = (float(value) for value in np.percentile(pixels.samples_dn, _PERCENTILES))
    # shown black is the black level or a darker one, white what is near the brightest
    low_dn = min(dark, float(np.mean(pixels.black_level_dn))) if low_dn is None else low_dn
    high_dn = max(bright, low_dn + 1.0) if high_dn is None else high_dn
    png = _draw(pixels, clipped, low_dn, high_dn, linear=not (frame.header or {}).get("rendered"))

    def store(session: Session) -> dict[str, Any]:
        of = {"organisation_id": claim.organisation_id, "frame_id": frame.id, "job_id": claim.job_id}
        drawn = Crop(id=new_id("crp"), asked=asked, png=png, **of)
        keep_crop(session, drawn)
        where = {"row0_px": row0, "col0_px": col0, "height_px": height, "width_px": width}
        return where | {
            "frame_id": frame.id,
            "crop_id": drawn.id,
            "picture": f"/v1/crops/{drawn.id}.png",
            "low_dn": low_dn,
            "high_dn": high_dn,
            "clipped_px": int(clipped.sum()),
        }

    return Outcome(store=store)


def _draw(pixels: Frame, clipped: NDArray[np.bool_], low_dn: float, high_dn: float, *, linear: bool) -> bytes:
    samples = pixels.samples_dn[..., 1] if pixels.samples_dn.ndim == 3 else pixels.samples_dn
    share = np.clip((samples.astype(np.float32) - low_dn) / (high_dn - low_dn), 0.0, 1.0)
    levels = np.round((_GREYS - 1) * (share**_GAMMA if linear else share)).astype(np.uint8)
    levels[clipped] = _GREYS
    picture = Image.fromarray(levels, "P")
    greys = [round(255 * level / (_GREYS - 1)) for level in range(_GREYS) for _ in "rgb"]
    picture.putpalette(greys + list(_CLIPPED))
    out = io.BytesIO()
    picture.save(out, "PNG")
    return out.getvalue()
