"""Vegetation indices of the bands of one capture."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected
from radiometry.frame import FrameHeader
from radiometry.frame.multispectral import Index
from radiometry.frame.roi import Polygon
from radiometry.reflectance import codes
from radiometry.reflectance.alignment import align, move_region
from radiometry.reflectance.imaging import require_band

NIR = "nir"
_SECOND: Mapping[Index, str] = {"ndvi": "red", "ndre": "red_edge", "gndvi": "green"}


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
class IndexMap:
    """An index on the pixels of the near infrared band.

    Attributes
    ----------
    index : Index
        Name of the index.
    values : ndarray of float32
        Index, (row, col); NaN where it does not exist.
    undefined : int
        Number of pixels where it does not exist.
    """

    index: Index
    values: NDArray[np.float32]
    undefined: int


def name_bands(index: Index) -> tuple[str, str]:
    """Return the two bands that an index compares.

    Parameters
    ----------
    index : Index
        Name of the index.

    Returns
    -------
    tuple[str, str]
        Near infrared and the other band.
    """
    return NIR, _SECOND[index]


def compute_index(index: Index, bands: Mapping[str, BandMap]) -> IndexMap:
    """Compute (NIR - X) / (NIR + X): X red for NDVI [1]_, red edge for NDRE, green for GNDVI [2]_.

    Parameters
    ----------
    index : Index
        Name of the index.
    bands : mapping of str to BandMap
        Maps by name of the band; both must be whole frames of one capture of one
        camera.

    Returns
    -------
    IndexMap
        The index on the pixels of the near infrared band.

    Raises
    ------
    InputRejected
        `bands_not_aligned` if they are not of one capture, or a file does not state
        the rotation of its band; `band_not_calibrated` if one is missing.

    Notes
    -----
    The second band is aligned onto the near infrared first. Where the sum of the
    two is zero or less the index does not exist: NaN, as where a band is saturated
    or did not look.

    References
    ----------
    .. [1] J. W. Rouse et al., Third ERTS Symposium, NASA SP-351, 309 (1974)
    .. [2] A. A. Gitelson, M. N. Merzlyak, Adv. Space Res. 22, 689 (1998),
           doi:10.1016/S0273-1177(97)01133-2
    """
    nir_name, other_name = name_bands(index)
    lacking = [name for name in (nir_name, other_name) if name not in bands]
    if lacking:
        raise InputRejected(
            codes.BAND_NOT_CALIBRATED,
            f"{index.upper()} needs the bands {nir_name} and {other_name} of one capture; "
            f"{' and '.join(lacking)} is not there. Upload the capture's other files.",
        )
    nir, other = bands[nir_name], bands[other_name]
    _require_one_capture(nir.header, other.header, sizes={each.reflectance.shape for each in (nir, other)})
    aligned = align(
        other.reflectance,
        of=require_band(other.header).geometry,
        onto=require_band(nir.header).geometry,
    )
    total = nir.reflectance + aligned
    exists = total > 0.0  # false for NaN
    values = np.full(total.shape, np.nan, np.float32)
    np.divide(nir.reflectance - aligned, total, out=values, where=exists)
    return IndexMap(index=index, values=values, undefined=int(np.count_nonzero(~exists)))


def align_region(polygon: Polygon, nir: FrameHeader, other: FrameHeader) -> tuple[Polygon, Polygon]:
    """Return a region of the near infrared frame as it and the capture's other band see it.

    Parameters
    ----------
    polygon : Polygon
        Region in the near infrared frame.
    nir, other : FrameHeader
        Metadata of the two files.

    Returns
    -------
    tuple[Polygon, Polygon]
        Region in the near infrared frame, and in the other.

    Raises
    ------
    InputRejected
        `bands_not_aligned` as in `compute_index`; `roi_outside_frame` if the other
        band sees nothing of it.
    """
    _require_one_capture(nir, other, sizes={(each.height_px, each.width_px) for each in (nir, other)})
    return move_region(
        polygon,
        of=require_band(other).geometry,
        onto=require_band(nir).geometry,
        height_px=nir.height_px,
        width_px=nir.width_px,
    )


def _require_one_capture(one: FrameHeader, other: FrameHeader, *, sizes: Collection[tuple[int, ...]]) -> None:
    captures = [require_band(each).capture_id for each in (one, other)]
    same = captures[0] is not None and captures[0] == captures[1]
    if not same or one.serial != other.serial or len(sizes) > 1:
        raise InputRejected(
            codes.BANDS_NOT_ALIGNED,
            "The two files are not bands of one capture (their capture ids, cameras or sizes differ): the "
            "camera had moved between them.",
        )
