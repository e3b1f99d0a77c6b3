"""Geometry: principal distance, principal point and distortion of a camera, from pictures of a board.

A direction (X/Z, Y/Z), distorted by k1, k2, k3, p1, p2 to (x', y'), appears at::

    col = fx x' + cx,  row = fy y' + cy

Corners of a checkerboard or ChArUco board in three views or more, best in ten, are fitted together with the
board's pose in each [1]_. The distortion is Brown's (1966), in OpenCV's notation.

References
----------
.. [1] Z. Zhang, A flexible new technique for camera calibration, IEEE TPAMI 22(11), 2000
"""

from collections.abc import Sequence

from radiometry.fitting.evidence import Extracted, Region
from radiometry.frame import Frame, FrameHeader
from radiometry.frame.exposure import Exposure
from radiometry.frame.verdicts import ReviewedFrame, Verdict
from radiometry.geometry.features import Features, extract_features
from radiometry.geometry.rows import FrameRow, Params
from radiometry.geometry.target import Target
from radiometry.geometry.verdicts import judge_frames


def extract(
    frame: Frame,
    regions: Sequence[Region],
    *,
    header: FrameHeader,
    exposure: Exposure | None,  # noqa: ARG001  a chart's shapes do not depend on it
    target: Target,
) -> Extracted[Features]:
    """Find the corners of the board in a window of a frame.

    Returns
    -------
    Extracted[Features]
        Statistics and corners; if the board is not there, the features contain the
        reason.
    """
    return extract_features(frame, regions, header=header, target=target)


def judge(
    frames: Sequence[ReviewedFrame],
    rows: Sequence[FrameRow],
    params: Params,  # noqa: ARG001  one picture is judged alike whatever the fit
) -> dict[str, Verdict]:
    """Return the verdict on each frame of a campaign."""
    return judge_frames(frames, rows)
