"""Measurement of every region of a frame in every channel, with the reasons of refused channels."""

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from radiometry.findings import InputRejected, shared
from radiometry.fitting.evidence import Extracted, Region
from radiometry.frame import Frame, FrameHeader
from radiometry.frame.exposure import Exposure
from radiometry.frame.roi import Window, bounding_window
from radiometry.frame.statistics import compute_statistics
from radiometry.sharpness import codes
from radiometry.sharpness.edges import measure_edge
from radiometry.sharpness.results import EdgeResponse, Features, Refusal, RegionResponse, StarResponse, Target
from radiometry.sharpness.sampling import LUMINANCE, Plane, Tone, average_sites, read_planes
from radiometry.sharpness.stars import guess_centre, measure_star, refine_centre

R = TypeVar("R")

_MAIN_CHANNELS = (LUMINANCE, "G", "grey")


def extract(
    frame: Frame,
    regions: Sequence[Region],
    *,
    header: FrameHeader,
    exposure: Exposure | None,  # noqa: ARG001  a chart needs none
    target: Target,
) -> Extracted[Features]:
    """Measure every region of a frame.

    A region is the box about its polygon: an edge must run from one side to the other. Channels that cannot
    be used are stored with the reason.
    """
    windows = [
        bounding_window(region.polygon, height_px=frame.height_px, width_px=frame.width_px)
        for region in regions
    ]
    tone = Tone(curve=target.tone_curve, gamma=target.gamma) if header.rendered else None
    inside = np.zeros(frame.samples_dn.shape[:2], np.bool_)
    found = []
    for region, window in zip(regions, windows, strict=True):
        found.append(_measure_region(frame, region, window, target=target, tone=tone))
        row0, col0 = window.row0 - frame.row0, window.col0 - frame.col0
        inside[row0 : row0 + window.height, col0 : col0 + window.width] = True
    if not any(each.edges or each.stars for each in found):
        raise _explain(found)
    features = Features(
        kind=target.kind,
        height_px=frame.height_px,
        width_px=frame.width_px,
        rendered=header.rendered,
        regions=tuple(found),
    )
    return Extracted(statistics=compute_statistics(frame, inside), features=features)


def _measure_region(
    frame: Frame, region: Region, window: Window, *, target: Target, tone: Tone | None
) -> RegionResponse:
    edges: list[EdgeResponse] = []
    stars: list[StarResponse] = []
    refused: list[Refusal] = []
    if target.kind == "slanted_edge":
        turned = _runs_along_rows(frame, window, tone)
        planes = read_planes(frame, window, tone=tone, transposed=turned)
        orientation = "horizontal" if turned else "vertical"
        rows = (window.row0, window.row0 + window.height - 1.0)
        cols = (window.col0, window.col0 + window.width - 1.0)
        box = (*cols, *rows) if turned else (*rows, *cols)
        for plane in planes:
            _try(
                edges,
                refused,
                plane,
                lambda one: measure_edge(one, order=target.edge_order, orientation=orientation, box=box),
            )
    else:
        planes = read_planes(frame, window, tone=tone, transposed=False)
        centre, radius_px = _find_star(frame, region, window, planes, target=target, tone=tone)
        for plane in planes:
            _try(
                stars,
                refused,
                plane,
                lambda one: measure_star(one, cycles=target.cycles, centre=centre, radius_px=radius_px),
            )
    return RegionResponse(
        name=region.name,
        row_px=window.row0 + (window.height - 1) / 2.0,
        col_px=window.col0 + (window.width - 1) / 2.0,
        edges=tuple(edges),
        stars=tuple(stars),
        refused=tuple(refused),
    )


def _try(found: list[R], refused: list[Refusal], plane: Plane, measure: Callable[[Plane], R]) -> None:
    try:
        found.append(measure(plane))
    except InputRejected as refusal:
        refused.append(Refusal(channel=plane.channel, code=str(refusal.code), message=refusal.message))


def _runs_along_rows(frame: Frame, window: Window, tone: Tone | None) -> bool:
    """Return True if the signal changes more from top to bottom than from left to right."""
    picture, _ = average_sites(frame, window, tone=tone)
    rows, cols = (max(1, size // 4) for size in picture.shape)
    down = abs(float(picture[:rows].mean() - picture[-rows:].mean()))
    across = abs(float(picture[:, :cols].mean() - picture[:, -cols:].mean()))
    return down > across


def _find_star(
    frame: Frame,
    region: Region,
    window: Window,
    planes: Sequence[Plane],
    *,
    target: Target,
    tone: Tone | None,
) -> tuple[tuple[float, float], float]:
    """Return a star's centre, (row, col) indices, and the radius [px] of the largest ring in its window."""
    given = {each.region: (each.y_px - 0.5, each.x_px - 0.5) for each in target.centres}
    if region.name in given:
        centre = given[region.name]
        return centre, _room(centre, window)
    picture, pitch_px = average_sites(frame, window, tone=tone)
    row, col = guess_centre(picture)
    inset = (pitch_px - 1.0) / 2.0
    first = (window.row0 + inset + pitch_px * row, window.col0 + inset + pitch_px * col)
    main = next(plane for name in _MAIN_CHANNELS for plane in planes if plane.channel == name)
    centre = refine_centre(main, start=first, cycles=target.cycles, radius_px=_room(first, window))
    return centre, _room(centre, window)


def _room(centre: tuple[float, float], window: Window) -> float:
    """Return the radius of the largest circle in a window."""
    row, col = centre[0] - window.row0, centre[1] - window.col0
    return max(1.0, min(row, col, window.height - 1 - row, window.width - 1 - col))


def _explain(found: Sequence[RegionResponse]) -> InputRejected:
    first = next(refusal for region in found for refusal in region.refused)
    where = f"Region {found[0].name}: " if found[0].name else ""
    entry = next(each for each in (*codes.FINDINGS, *shared.FINDINGS) if each == first.code)
    return InputRejected(entry, f"{where}{first.message}")
