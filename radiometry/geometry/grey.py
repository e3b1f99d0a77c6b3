"""Grey picture of a frame, whatever the frame contains, in which corners are searched."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radiometry.frame import Frame
from radiometry.frame.opencv import cv2

BINOMIAL: Final = np.array([0.25, 0.5, 0.25])
_DARK_PERCENTILE, _BRIGHT_PERCENTILE = 0.5, 99.5
_PERCENTILE_SAMPLES: Final = 1 << 20


@dataclass(frozen=True)
class Grey:
    """Grey picture in two forms, (row, col).

    Attributes
    ----------
    coarse : ndarray of uint8
        Picture in which a board is searched.
    fine : ndarray of uint8 or ndarray of float32
        Picture in which corners are placed.
    """

    coarse: NDArray[np.uint8]
    fine: NDArray[np.uint8] | NDArray[np.float32]


def make_grey(frame: Frame, *, bits_per_sample: int) -> Grey:
    """Return the grey picture; the transposed frame gives the transposed picture.

    Notes
    -----
    A mosaic is smoothed by 1/4 [1 2 1] along rows and along columns. Around every pixel, of whatever
    colour, the four sites of its cell then weigh 1/4 each and lie symmetrically: the pattern vanishes and
    no edge moves. Colour pictures are weighted as OpenCV does, .299 R + .587 G + .114 B.

    Pictures of 8 bits are taken as they are. In all others, corners are placed in float32, and boards
    searched in 8 bits that run straight from the 0.5th percentile to the 99.5th.
    """
    samples = frame.samples_dn
    if frame.cfa == "rgb" and bits_per_sample == 8:
        plain = np.asarray(cv2.cvtColor(samples.astype(np.uint8), cv2.COLOR_RGB2GRAY), np.uint8)
        return Grey(plain, plain)
    if frame.cfa == "grey" and bits_per_sample == 8:
        plain = samples.astype(np.uint8)
        return Grey(plain, plain)
    fine = _make_fine(frame)
    return Grey(_stretch(fine), fine)


def _make_fine(frame: Frame) -> NDArray[np.float32]:
    if frame.cfa == "rgb":
        return np.asarray(cv2.cvtColor(frame.samples_dn, cv2.COLOR_RGB2GRAY), np.float32)
    if frame.cfa == "grey":
        return frame.samples_dn.astype(np.float32)
    # the border mirrored about its outermost pixel keeps the pattern's phase
    smooth = cv2.sepFilter2D(
        frame.samples_dn, cv2.CV_32F, BINOMIAL, BINOMIAL, borderType=cv2.BORDER_REFLECT_101
    )
    return np.asarray(smooth, np.float32)


def _stretch(fine: NDArray[np.float32]) -> NDArray[np.uint8]:
    step = max(1, int(np.sqrt(fine.size / _PERCENTILE_SAMPLES)))
    low, high = np.percentile(fine[::step, ::step], (_DARK_PERCENTILE, _BRIGHT_PERCENTILE))
    share = (fine - np.float32(low)) / np.float32(max(high - low, 1.0))
    return np.asarray(np.round(np.clip(share, 0.0, 1.0) * 255.0), np.uint8)
