"""The bands of one capture on the pixels of one of them, and indices of them."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected
from radiometry.frame import FrameHeader
from radiometry.frame.multispectral import Alignment, RigGeometry
from radiometry.frame.roi import Polygon, Window, mask
from radiometry.reflectance import codes
from radiometry.reflectance.alignment import align, move_region, require_lens_data
from radiometry.reflectance.formula import Formula, compute
from radiometry.reflectance.imaging import require_band
from radiometry.reflectance.registration import IDENTITY, register

UNREFINED_PX = 5.0
"""What is assumed to remain without a refinement: the most that lens data left on the real captures."""

_REACH_PX, _WIDE_REACH_PX = 24, 96


@dataclass(frozen=True, kw_only=True)
class BandMap:
    """Reflectance of one band's whole frame.

    Attributes
    ----------
    header : FrameHeader
        Metadata of the band's file.
    reflectance : ndarray of float32
        Reflectance, (row, col).
    """

    header: FrameHeader
    reflectance: NDArray[np.float32]


@dataclass(frozen=True, kw_only=True)
class AlignedBand:
    """A band on the pixels of the first of its capture.

    Attributes
    ----------
    reflectance : ndarray of float32
        Reflectance, (row, col); NaN where the band did not look, or was saturated.
    alignment : Alignment
        How it was aligned.
    """

    reflectance: NDArray[np.float32]
    alignment: Alignment


@dataclass(frozen=True, kw_only=True)
class IndexMap:
    """An index on the pixels of the first of its bands.

    Attributes
    ----------
    values : ndarray of float32
        Index, (row, col); NaN where it is not defined.
    undefined : int
        Number of pixels where it is not defined.
    """

    values: NDArray[np.float32]
    undefined: int


def align_band(band: BandMap, first: BandMap) -> AlignedBand:
    """Align a band onto another of its capture by lens data, then by correlation.

    Parameters
    ----------
    band, first : BandMap
        Whole frames of one capture: the band to align, and the one whose pixels are the result.

    Returns
    -------
    AlignedBand
        The band on the pixels of `first`.

    Raises
    ------
    InputRejected
        `bands_not_aligned` if they are not of one capture, or if neither the files nor the correlation tell
        how they are turned.
    """
    require_capture(first.header, band.header)
    if band.reflectance.shape != first.reflectance.shape:
        raise _refuse_capture()
    of, onto, turned = _read_lenses(band.header, first.header)
    plane = align(band.reflectance, of=of, onto=onto)
    found = register(first.reflectance, plane, reach_px=_REACH_PX if turned else _WIDE_REACH_PX)
    name = require_band(band.header).band
    if not found.trusted or found.residual_px is None:
        require_lens_data(require_band(band.header).geometry)
        require_lens_data(require_band(first.header).geometry)
        alignment = Alignment(
            band=name,
            by="lens_data",
            residual_px=UNREFINED_PX,
            shift_px=(0.0, 0.0),
            patches=found.patches,
            tried=found.tried,
        )
        return AlignedBand(reflectance=plane, alignment=alignment)
    alignment = Alignment(
        band=name,
        by="lens_data_and_correlation" if turned else "correlation",
        residual_px=found.residual_px,
        shift_px=found.shift_px,
        patches=found.patches,
        tried=found.tried,
        matrix=found.matrix,
    )
    plane = align(band.reflectance, of=of, onto=onto, matrix=found.matrix)
    return AlignedBand(reflectance=plane, alignment=alignment)


def compute_index(formula: Formula, planes: Mapping[str, NDArray[np.float32]]) -> IndexMap:
    """Compute an index of aligned bands, such as NDVI [1]_, GNDVI [2]_, EVI2 [3]_ and SAVI [4]_.

    Parameters
    ----------
    formula : Formula
        Index.
    planes : mapping of str to ndarray of float32
        Reflectance by band on the same pixels.

    Returns
    -------
    IndexMap
        Index; NaN where a divisor is zero, or below it for a named index, and where a band is saturated or
        did not look.

    References
    ----------
    .. [1] J. W. Rouse et al., Third ERTS Symposium, NASA SP-351, 309 (1974)
    .. [2] A. A. Gitelson, M. N. Merzlyak, Adv. Space Res. 22, 689 (1998),
           doi:10.1016/S0273-1177(97)01133-2
    .. [3] Z. Jiang et al., Remote Sens. Environ. 112, 3833 (2008), doi:10.1016/j.rse.2008.06.006
    .. [4] A. R. Huete, Remote Sens. Environ. 25, 295 (1988), doi:10.1016/0034-4257(88)90106-X
    """
    values = np.asarray(compute(formula, planes)[0], np.float32)
    return IndexMap(values=values, undefined=int(np.count_nonzero(np.isnan(values))))


def move_regions(
    polygon: Polygon, first: FrameHeader, others: Sequence[tuple[FrameHeader, tuple[float, ...] | None]]
) -> tuple[Polygon, ...]:
    """Return a region of a frame as it and the other bands of its capture see it.

    Parameters
    ----------
    polygon : Polygon
        Region in the frame of `first`.
    first : FrameHeader
        Metadata of the first band's file.
    others : sequence of tuple[FrameHeader, tuple of float or None]
        Metadata of the others, with the correction of their alignment; None for none.

    Returns
    -------
    tuple of Polygon
        Region in the first frame, as far as all bands see it, and in the others.

    Raises
    ------
    InputRejected
        `bands_not_aligned` as in `align_band`; `roi_outside_frame` if a band sees nothing of it.
    """
    here, there = polygon, []
    # once more than there are bands: what the last of them does not see is cut off for the first too
    for header, matrix in (*others, *others):
        require_capture(first, header)
        of, onto, _ = _read_lenses(header, first)
        size = {"height_px": first.height_px, "width_px": first.width_px}
        here, moved = move_region(here, of=of, onto=onto, matrix=matrix or IDENTITY, **size)
        there.append(moved)
    return here, *there[len(others) :]


def require_capture(one: FrameHeader, other: FrameHeader) -> None:
    """Refuse two files that are not bands of one capture.

    Raises
    ------
    InputRejected
        `bands_not_aligned`.
    """
    captures = [require_band(each).capture_id for each in (one, other)]
    same = captures[0] is not None and captures[0] == captures[1]
    sizes = {(each.height_px, each.width_px) for each in (one, other)}
    if not same or one.serial != other.serial or len(sizes) > 1:
        raise _refuse_capture()


def _refuse_capture() -> InputRejected:
    return InputRejected(
        codes.BANDS_NOT_ALIGNED,
        "The two files are not bands of one capture (their capture ids, cameras or sizes differ): the camera "
        "had moved between them.",
    )


def _read_lenses(band: FrameHeader, first: FrameHeader) -> tuple[RigGeometry, RigGeometry, bool]:
    """Return both lenses, and True if their files state how they are turned against each other."""
    lenses = [require_lens_data(require_band(each).geometry, turned=False) for each in (band, first)]
    turned = all(each.offset_px or each.rotation_deg is not None for each in lenses)
    if not turned:
        lenses = [replace(each, rotation_deg=(0.0, 0.0, 0.0), offset_px=None) for each in lenses]
    return lenses[0], lenses[1], turned


def spread_plane(plane: NDArray[np.float32], *, residual_px: float) -> NDArray[np.float32]:
    """Compute by how much a band may differ in each pixel for what remains of its displacement.

    Parameters
    ----------
    plane : ndarray of float32
        Reflectance, (row, col).
    residual_px : float
        Root mean square distance that remains [px].

    Returns
    -------
    ndarray of float32
        Gradient times the distance along it, of which the rms is residual / sqrt(2) for either axis.
    """
    down, across = np.gradient(plane)
    return np.asarray(np.hypot(down, across) * (residual_px / math.sqrt(2.0)), np.float32)


def displace_region(plane: NDArray[np.float32], polygon: Polygon, *, residual_px: float) -> float:
    """Compute by how much a region's mean may differ for what remains of the band's displacement.

    Parameters
    ----------
    plane : ndarray of float32
        Reflectance on the pixels of the region, (row, col).
    polygon : Polygon
        Region.
    residual_px : float
        Root mean square distance that remains [px].

    Returns
    -------
    float
        Change of the mean for residual / sqrt(2) along either axis, both added in squares.
    """
    step = residual_px / math.sqrt(2.0)
    reach = max(1, round(step))
    height, width = plane.shape
    inside = mask(polygon, Window(row0=0, col0=0, height=height, width=width))
    changes = []
    for axis in (0, 1):
        slope = (np.roll(plane, -reach, axis) - np.roll(plane, reach, axis)) / (2.0 * reach)
        slope = np.moveaxis(slope, axis, 0)
        slope[:reach] = slope[-reach:] = np.nan
        found = np.moveaxis(slope, 0, axis)[inside]
        known = found[np.isfinite(found)]
        changes.append(step * float(known.mean(dtype=np.float64)) if known.size else 0.0)
    return math.hypot(*changes)
