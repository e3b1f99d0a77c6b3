"""JPEG and PNG pictures: for charts only, where shapes are measured and not light."""

from collections.abc import Iterator
from typing import Final

import imagecodecs
import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected, files
from radiometry.frame import FrameHeader
from radiometry.frame.proof import PieceRun, Voucher
from worker.decode import jpeg, limits, png
from worker.decode.metadata import Metadata, read_metadata
from worker.decode.source import Source
from worker.decode.tiff import Directory, is_tiff, read_directories

# A picture is decoded as a whole: three times as many bytes, and twice that as the window that is sent.
MAX_PICTURE_PX: Final = 100_000_000
_NOTHING: Final = Directory(b"", "<", {})


def is_picture(head: bytes) -> bool:
    return head.startswith((jpeg.MAGIC, png.MAGIC))


class PictureFile:
    """An opened JPEG or PNG. It is decoded whenever samples are asked for, and never kept."""

    band_rows = 1 << 16

    def __init__(self, source: Source) -> None:
        self._source = source
        content = source[:]
        self._jpeg = content[:3] == jpeg.MAGIC
        if self._jpeg:
            claims = jpeg.read_claims(content)
            self.header = _describe(
                "jpeg", claims.height_px, claims.width_px, claims.samples, bits=8, exif=claims.exif
            )
        else:
            found = png.read_claims(content)
            self.header = _describe(
                "png", found.height_px, found.width_px, found.samples, bits=found.bits, exif=found.exif
            )

    def read(self, row0: int, col0: int, height: int, width: int) -> NDArray[np.uint16]:
        window = self._decode()[row0 : row0 + height, col0 : col0 + width]
        return window.astype(np.uint16)

    lowest_dn = 0.0

    def bands(self) -> Iterator[tuple[int, NDArray[np.uint16]]]:
        """The picture's rows, which are decoded in one go."""
        yield 0, self._decode().astype(np.uint16)

    def vouch(self) -> tuple[Voucher, tuple[PieceRun, ...]]:
        """Return what proves the samples whole: a PNG has checksums, a JPEG only an end."""
        return "end" if self._jpeg else "checksum", ()

    def black_level(self, *_window: int) -> tuple[float, ...]:
        return self.header.black_level_dn

    def _decode(self) -> NDArray[np.uint8 | np.uint16]:
        header = self.header
        decode = imagecodecs.jpeg8_decode if self._jpeg else imagecodecs.png_decode
        try:
            samples: NDArray[np.uint8 | np.uint16] = decode(self._source[:])
        except (RuntimeError, ValueError) as error:
            raise files.SIZE_MISMATCH.refuse("The picture cannot be decoded.") from error
        colours = (3,) if header.cfa == "rgb" else ()
        wanted = np.uint8 if header.bits_per_sample == 8 else np.uint16
        if samples.shape != (header.height_px, header.width_px, *colours) or samples.dtype != wanted:
            raise files.SIZE_MISMATCH.refuse("The picture is not what its own header says.")
        return samples


def _describe(
    container: str, height_px: int, width_px: int, samples: int, *, bits: int, exif: bytes
) -> FrameHeader:
    limits.check_frame_size(height_px, width_px)
    if height_px * width_px > MAX_PICTURE_PX:
        raise files.FRAME_TOO_LARGE.refuse(
            f"The picture claims {width_px} x {height_px} pixels, above the limit of "
            f"{MAX_PICTURE_PX // 1_000_000} megapixels.",
        )
    return FrameHeader(
        container=container,
        decoder="imagecodecs",
        rendered=True,
        compression="jpeg" if container == "jpeg" else "deflate",
        bits_per_sample=bits,
        width_px=width_px,
        height_px=height_px,
        cfa="rgb" if samples == 3 else "grey",
        black_level_dn=(0.0,) * samples,
        black_level_origin="default",
        white_level_dn=(float((1 << bits) - 1),) * samples,
        white_level_origin="default",
        # Whoever needs bands reads the picture in one: each would decode all of it.
        band_rows=height_px,
        first_band_rows=height_px,
        **vars(_read_exif(exif)),
    )


def _read_exif(exif: bytes) -> Metadata:
    """Read what the camera wrote beside the picture; damage there costs the metadata and not the picture."""
    try:
        main = read_directories(exif)[0] if is_tiff(exif) else _NOTHING
    except InputRejected:
        main = _NOTHING
    return read_metadata(main)
