"""Frames of given samples."""

import numpy as np

from radiometry.frame import Frame


def frame_of(samples, *, cfa="RGGB", row0=0, col0=0, size=None, black=256.0, white=4095.0, clipped=False):
    """Samples are rounded, and clipped at white where asked for.

    A level goes for every site. ``size`` : rows and columns of the frame, of which the samples may be a part.
    """
    samples = np.rint(samples)
    samples = (np.clip(samples, 0, white) if clipped else samples).astype(np.uint16)
    height_px, width_px = size or (row0 + samples.shape[0], col0 + samples.shape[1])
    sites = {"grey": 1, "rgb": 3}.get(cfa, 4)
    return Frame(
        samples_dn=samples,
        row0=row0,
        col0=col0,
        height_px=height_px,
        width_px=width_px,
        cfa=cfa,
        black_level_dn=(black,) * sites if isinstance(black, float) else black,
        white_level_dn=(white,) * sites if isinstance(white, float) else white,
    )
