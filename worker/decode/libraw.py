"""Files that only LibRaw can decode: other makers' raw files, and the DNG features not read natively."""

import ctypes
import io
import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

import numpy as np
import rawpy
from numpy.typing import NDArray

from radiometry.findings import files
from radiometry.frame import FrameHeader
from worker.decode import layout, limits, tiff

# Before 0.28.0 rawpy carried a LibRaw with known heap overflows in DNG decoding.
_OLDEST_RAWPY = (0, 28)
# Canon's and Fuji's lossy ways stay above this; half a bit per sample is no picture of a sensor's noise.
_MOST_SAMPLES_PER_BYTE = 16
_M_PERTURB = -6  # of glibc's mallopt: what is allocated is filled with the byte's complement
_FILLS: Final = (0x5A, 0xC3)


def check_version() -> str:
    version: str = rawpy.__version__  # type: ignore[attr-defined]
    if tuple(int(part) for part in version.split(".")[:2]) < _OLDEST_RAWPY:
        raise RuntimeError(f"rawpy {version} decodes DNG unsafely: 0.28 or newer is needed")
    return version


class LibRawFile:
    """A file decoded as a whole: LibRaw knows no less, and even its colour pattern only afterwards.

    LibRaw reports success also where it decoded nothing, and its memory then holds what was there before. So
    the memory is filled with a pattern first, and what still has the pattern afterwards was never written.

    ``mosaic`` : (row, col) uint16, masked borders included
    ``area`` : what will be read of it; LibRaw's visible area where nothing else is said
    """

    def __init__(self, source: tiff.Source, allow: limits.Allow, area: layout.Area | None = None) -> None:
        content = source[:]
        self._raw: Any = _open(content)
        sizes = self._raw.sizes
        limits.check_frame_size(sizes.raw_height, sizes.raw_width)
        limits.check_frame_size(sizes.height, sizes.width)
        samples = sizes.raw_height * sizes.raw_width
        limits.check_backed(samples, len(content) * _MOST_SAMPLES_PER_BYTE)
        allow(samples)
        self.mosaic = self._decode(content, area or self.visible)

    @property
    def visible(self) -> layout.Area:
        """As LibRaw sees it: it moves odd margins to even ones."""
        sizes = self._raw.sizes
        top, left = sizes.top_margin, sizes.left_margin
        return layout.Area(top, left, top + sizes.height, left + sizes.width)

    def _decode(self, content: bytes, area: layout.Area) -> NDArray[np.uint16]:
        mosaic = _unpack(self._raw, _FILLS[0])
        if mosaic.shape[0] < area.bottom or mosaic.shape[1] < area.right:
            raise files.UNSUPPORTED_LAYOUT.refuse("The file holds no single mosaic of samples.")
        seen = (slice(area.top, area.bottom), slice(area.left, area.right))
        untouched = mosaic[seen] == _pattern(_FILLS[0])
        if untouched.any():
            # The pattern may be a sample's true value: one that was decoded is the same over another pattern.
            again = _unpack(_open(content), _FILLS[1])[seen]
            if np.any(untouched & (again == _pattern(_FILLS[1]))):
                raise files.TRUNCATED.refuse("The decoder found no data for a part of the image.")
        # LibRaw leaves zeros where data is missing, too. A dark frame which its camera clips at zero may hold
        # lines of them, but also some noise. In a frame that is mostly lit or all zero they are no sensor's.
        lit = np.count_nonzero(mosaic[seen], axis=1)
        missing = np.any((lit[1:] == 0) & (lit[:-1] == 0))
        if missing and not 0 < lit.sum() < untouched.size / 2:
            raise files.TRUNCATED.refuse("Lines of the image are missing.")
        return mosaic

    def header(self, metadata: dict[str, Any] | None) -> FrameHeader:
        """Return the header by LibRaw, and by the file's own EXIF where it could be read."""
        cfa = self._read_cfa()
        sites = 1 if cfa == "grey" else 4
        white = float(self._raw.white_level)
        stated = metadata if metadata is not None else self._read_metadata()
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
        if cfa not in layout.BAYER:
            raise files.UNSUPPORTED_LAYOUT.refuse(f"The sensor's colour pattern {cfa} is no Bayer pattern.")
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


def _open(content: bytes) -> Any:  # noqa: ANN401  rawpy's class is no type
    try:
        return rawpy.imread(io.BytesIO(content))
    except (rawpy.LibRawError, OSError, ValueError) as error:
        raise files.NOT_A_RAW_FILE.refuse("The file is no raw image that can be read.") from error


def _unpack(raw: Any, fill: int) -> NDArray[np.uint16]:  # noqa: ANN401  rawpy's class is no type
    """All samples; those that LibRaw does not write have the fill's pattern."""
    try:
        with _filled_memory(fill):
            mosaic: NDArray[np.uint16] | None = raw.raw_image
    except (rawpy.LibRawError, OSError, ValueError, RuntimeError) as error:
        raise files.TRUNCATED.refuse("The image cannot be decoded to its end.") from error
    if mosaic is None or mosaic.ndim != 2 or mosaic.dtype != np.uint16:
        raise files.UNSUPPORTED_LAYOUT.refuse("The file holds no single mosaic of samples.")
    return mosaic


@contextmanager
def _filled_memory(fill: int) -> Iterator[None]:
    """Have the C library fill all memory that it gives out; without that, nothing is decoded here."""
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is None or not mallopt(_M_PERTURB, fill ^ 0xFF):
        raise files.UNSUPPORTED_LAYOUT.refuse("This system cannot prove what LibRaw decodes.")
    try:
        yield
    finally:
        mallopt(_M_PERTURB, 0)


def _pattern(fill: int) -> np.uint16:
    return np.uint16(fill << 8 | fill)


def _known(value: float | str | None) -> float | str | None:
    if isinstance(value, str):
        return value.strip()[: limits.MAX_TEXT] or None
    return value if value is not None and math.isfinite(value) and value > 0 else None
