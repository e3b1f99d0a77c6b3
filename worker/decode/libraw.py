"""What only LibRaw can decode: other makers' raw files, and the DNG features that are not read natively."""

import importlib.metadata
import math
from pathlib import Path
from typing import Any

import numpy as np
import rawpy
from numpy.typing import NDArray

from radiometry.frame import FrameHeader
from worker.decode import limits
from worker.decode.metadata import Metadata
from worker.decode.mosaic import BAYER, Area
from worker.decode.refusals import Refusal, refuse

# Before 0.28.0 rawpy carried a LibRaw with known heap overflows in DNG decoding.
_OLDEST_RAWPY = (0, 28)


def check_version() -> str:
    version = importlib.metadata.version("rawpy")
    if tuple(int(part) for part in version.split(".")[:2]) < _OLDEST_RAWPY:
        raise RuntimeError(f"rawpy {version} decodes DNG unsafely: 0.28 or newer is needed")
    return version


class LibRawFile:
    """A file decoded as a whole: LibRaw knows no less, and even its colour pattern only afterwards.

    ``mosaic`` : (row, col) uint16, masked borders included
    """

    def __init__(self, path: Path) -> None:
        try:
            self._raw: Any = rawpy.imread(str(path))
        except (rawpy.LibRawError, OSError, ValueError) as error:
            raise refuse(Refusal.NOT_A_RAW_FILE, "The file is no raw image that can be read.") from error
        sizes = self._raw.sizes
        limits.check_frame_size(sizes.raw_height, sizes.raw_width)
        limits.check_frame_size(sizes.height, sizes.width)
        self.mosaic = self._decode()

    @property
    def visible(self) -> Area:
        """As LibRaw sees it: it moves odd margins to even ones."""
        sizes = self._raw.sizes
        return Area(
            sizes.top_margin,
            sizes.left_margin,
            sizes.top_margin + sizes.height,
            sizes.left_margin + sizes.width,
        )

    def _decode(self) -> NDArray[np.uint16]:
        try:
            mosaic: NDArray[np.uint16] | None = self._raw.raw_image
        except (rawpy.LibRawError, OSError, ValueError, RuntimeError) as error:
            raise refuse(Refusal.TRUNCATED, "The image cannot be decoded to its end.") from error
        bottom, right = self.visible.bottom, self.visible.right
        flat = mosaic is not None and mosaic.ndim == 2 and mosaic.dtype == np.uint16
        if mosaic is None or not flat or mosaic.shape[0] < bottom or mosaic.shape[1] < right:
            raise refuse(Refusal.UNSUPPORTED_LAYOUT, "The file holds no single mosaic of samples.")
        # LibRaw leaves zeros where data is missing; a sensor's last lines are never all zero.
        if not mosaic[bottom - 2 : bottom].any():
            raise refuse(Refusal.TRUNCATED, "The last lines of the image are missing.")
        return mosaic

    def header(self, metadata: Metadata | None) -> FrameHeader:
        """From LibRaw, and from the file's own EXIF where it could be read."""
        cfa = self._read_cfa()
        sites = 1 if cfa == "grey" else 4
        white = float(self._raw.white_level)
        stated = vars(metadata) if metadata is not None else self._read_metadata()
        return FrameHeader(
            container="raw",
            decoder="libraw",
            rendered=False,
            compression="libraw",
            bits_per_sample=max(8, min(16, math.ceil(math.log2(white + 1)))) if white > 0 else 16,
            width_px=self.visible.width,
            height_px=self.visible.height,
            cfa=cfa,
            black_level_dn=self._read_black_levels(sites),
            black_level_origin="libraw",
            white_level_dn=(white,) * sites,
            white_level_origin="libraw",
            **stated,
        )

    def _read_cfa(self) -> str:
        pattern = self._raw.raw_pattern
        if pattern is None:
            return "grey"
        letters = self._raw.color_desc.decode("ascii", "replace")
        cfa = "".join(letters[index] for index in np.asarray(pattern).ravel() if index < len(letters))
        if cfa not in BAYER:
            raise refuse(
                Refusal.UNSUPPORTED_LAYOUT, f"The sensor's colour pattern {cfa} is no Bayer pattern."
            )
        return cfa

    def _read_black_levels(self, sites: int) -> tuple[float, ...]:
        per_colour = [float(level) for level in self._raw.black_level_per_channel]
        if sites == 1:
            return (per_colour[0],)
        return tuple(per_colour[index] for index in np.asarray(self._raw.raw_pattern).ravel())

    def _read_metadata(self) -> dict[str, float | str | None]:
        """LibRaw writes zero for what it does not know."""
        other, lens = self._raw.other, self._raw.lens
        known: dict[str, float | str | None] = {
            "exposure_time_s": other.shutter_speed,
            "f_number": other.aperture,
            "iso": other.iso_speed,
            "lens_make": lens.make,
            "lens_model": lens.model,
        }
        return {name: _known(value) for name, value in known.items()}


def _known(value: float | str | None) -> float | str | None:
    if isinstance(value, str):
        return value.strip()[: limits.MAX_TEXT] or None
    return value if value is not None and math.isfinite(value) and value > 0 else None
