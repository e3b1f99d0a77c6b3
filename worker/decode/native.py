"""DNG and TIFF files, of which only the parts that a window needs are read."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from radiometry.frame import FrameHeader
from worker.decode import ljpeg, tags
from worker.decode.layout import Layout, read_layout
from worker.decode.levels import BlackLevels, read_black_levels, read_linearization, read_white_levels
from worker.decode.libraw import LibRawFile
from worker.decode.metadata import read_metadata
from worker.decode.mosaic import Area, read_cfa, read_visible_area
from worker.decode.multispectral import read_multispectral
from worker.decode.opcodes import read_opcodes
from worker.decode.refusals import Refusal, refuse
from worker.decode.segments import COMPRESSIONS, read_samples
from worker.decode.source import Source
from worker.decode.tiff import Directory


@dataclass(frozen=True)
class ImageDescription:
    """One image of a file: how it is stored and what its samples mean."""

    header: FrameHeader
    layout: Layout
    visible: Area
    black: BlackLevels
    table: NDArray[np.uint16] | None


def describe_dng(raw: Directory, main: Directory, file_size: int) -> ImageDescription:
    _refuse_lossy(raw)
    layout = read_layout(raw, file_size)
    if layout.samples != 1:
        raise refuse(Refusal.UNSUPPORTED_LAYOUT, f"The raw image has {layout.samples} samples per pixel.")
    if layout.compression not in COMPRESSIONS:
        raise refuse(
            Refusal.UNSUPPORTED_COMPRESSION, f"The raw image is compressed by method {layout.compression}."
        )
    return _describe(raw, main, layout, cfa=read_cfa(raw), container="dng")


def describe_tiff(image: Directory, file_size: int) -> ImageDescription:
    if image.integer(tags.COMPRESSION, tags.UNCOMPRESSED) not in set(COMPRESSIONS) - {tags.JPEG}:
        raise refuse(Refusal.UNSUPPORTED_COMPRESSION, "The TIFF's compression is not read.")
    layout = read_layout(image, file_size)
    rgb = image.integer(tags.PHOTOMETRIC, -1) == tags.PHOTOMETRIC_RGB
    if layout.bits not in (8, 16) or layout.samples != (3 if rgb else 1):
        raise refuse(
            Refusal.UNSUPPORTED_LAYOUT,
            f"The TIFF has {layout.samples} samples of {layout.bits} bits per pixel: neither grey nor RGB.",
        )
    return _describe(image, image, layout, cfa="rgb" if rgb else "grey", container="tiff")


def _describe(
    image: Directory, main: Directory, layout: Layout, *, cfa: str, container: str
) -> ImageDescription:
    if layout.predictor not in (1, 2) or (
        layout.predictor == 2 and layout.samples * layout.bits not in (8, 16, 24, 48)
    ):
        raise refuse(
            Refusal.UNSUPPORTED_COMPRESSION, "The image is compressed with a predictor that is not read."
        )
    dng = container == "dng"
    visible = (
        read_visible_area(image, layout.rows, layout.cols) if dng else Area(0, 0, layout.rows, layout.cols)
    )
    black = read_black_levels(image, height=visible.height, width=visible.width, samples=layout.samples)
    table = read_linearization(image) if dng else None
    white, white_origin = read_white_levels(image, samples=layout.samples, bits=layout.bits, table=table)
    cell = 1 if cfa in ("grey", "rgb") else 2
    band = read_multispectral(main, bits=layout.bits) if cfa == "grey" else None
    if band is not None and band.full_scale_dn is not None and white_origin == "default":
        white, white_origin = (band.full_scale_dn,), "camera"
    header = FrameHeader(
        container=container,
        decoder="stilb",
        # Multispectral cameras write raw samples as TIFF; their XMP or a black level tells them from others.
        rendered=not dng and band is None and tags.BLACK_LEVEL not in image,
        compression=COMPRESSIONS[layout.compression],
        bits_per_sample=layout.bits,
        width_px=visible.width,
        height_px=visible.height,
        cfa=cfa,
        black_level_dn=black.mean_over(0, 0, visible.height, visible.width, cell=cell),
        black_level_origin=black.origin,
        white_level_dn=white * cell**2,
        white_level_origin=white_origin,
        opcodes=read_opcodes(image),
        multispectral=band,
        band_rows=layout.band_rows,
        first_band_rows=layout.band_rows - visible.top % layout.band_rows,
        **vars(read_metadata(main)),
    )
    return ImageDescription(header, layout, visible, black, table)


def _refuse_lossy(raw: Directory) -> None:
    compression = raw.integer(tags.COMPRESSION, tags.UNCOMPRESSED)
    if raw.integer(tags.PHOTOMETRIC, -1) == tags.PHOTOMETRIC_LINEAR_RAW:
        raise refuse(
            Refusal.LINEAR_RAW, "The DNG holds an interpolated colour image, not the sensor's mosaic."
        )
    if compression == tags.LOSSY_JPEG:
        raise refuse(Refusal.LOSSY_DNG, "The DNG is compressed with loss.")
    if compression == tags.JPEG_XL:
        raise refuse(Refusal.UNSUPPORTED_COMPRESSION, "The DNG is compressed with JPEG XL.")


class NativeFile:
    """An opened DNG or TIFF."""

    def __init__(self, source: Source, path: Path, description: ImageDescription) -> None:
        self._source = source
        self._path = path
        self._image = description
        self._libraw: LibRawFile | None = None
        self.header = description.header

    @property
    def band_rows(self) -> int:
        """Rows that are read together most cheaply: those of a compressed strip or tile."""
        return self._image.layout.band_rows

    def read(self, row0: int, col0: int, height: int, width: int) -> NDArray[np.uint16]:
        image = self._image
        top, left = image.visible.top + row0, image.visible.left + col0
        if self._libraw is not None:
            return self._libraw.mosaic[top : top + height, left : left + width]
        try:
            samples = read_samples(self._source, image.layout, top, left, height, width)
        except ljpeg.NotDecodedHereError:
            self._hand_to_libraw()
            return self.read(row0, col0, height, width)
        linear = samples if image.table is None else np.take(image.table, samples)
        return linear[:, :, 0] if image.layout.samples == 1 else linear

    def black_level(self, row0: int, col0: int, height: int, width: int) -> tuple[float, ...]:
        cell = 1 if self.header.cfa in ("grey", "rgb") else 2
        return self._image.black.mean_over(row0, col0, height, width, cell=cell)

    def _hand_to_libraw(self) -> None:
        """Only the decoding changes hands: levels and metadata are still the file's own."""
        self._source.prove_all()
        libraw = LibRawFile(self._path)
        if libraw.mosaic.shape != (self._image.layout.rows, self._image.layout.cols):
            raise refuse(Refusal.UNSUPPORTED_LAYOUT, "LibRaw sees an image of another size in this file.")
        self._libraw = libraw
        self.header = replace(self.header, decoder="libraw")
