"""DNG and TIFF files, of which only the parts that a window needs are read."""

import hashlib
import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import files
from radiometry.frame import FrameHeader, proof
from worker.decode import dialects, limits, ljpeg, metadata, segments, tags, tiff
from worker.decode import layout as layouts
from worker.decode.libraw import LibRawFile

_TILE_PX: Final = 256
_DIGEST_BYTES: Final = 16
_BYTE_BITS: Final = 8
# Lightroom 1.4 spoilt the first four bytes of RawImageDigest; the SDK lets such files pass.
_SPOILT_BYTES: Final = 4
_SPOILT_START: Final = b"\x08\0\0\0"


@dataclass(frozen=True)
class StatedDigest:
    """``tiled`` : it is a NewRawImageDigest; ``bytewise`` : of 8 bits a pixel."""

    value: bytes
    tiled: bool
    bytewise: bool


def read_digest(raw: tiff.Directory, main: tiff.Directory, *, bits: int) -> StatedDigest | None:
    """Return the digest that the file states; the newer one where it has both."""
    for tag, tiled in ((tags.NEW_RAW_IMAGE_DIGEST, True), (tags.RAW_IMAGE_DIGEST, False)):
        for directory in (main, raw):
            value = directory.raw(tag, at_most=_DIGEST_BYTES)
            if len(value) == _DIGEST_BYTES and any(value):
                short = bits <= _BYTE_BITS or 0 < raw.count(tags.LINEARIZATION_TABLE) <= 1 << _BYTE_BITS
                return StatedDigest(value, tiled, tiled and short)
    return None


class DigestCheck:
    """Computes a digest from rows of samples as they are stored, from the top, whole rows."""

    def __init__(self, stated: StatedDigest) -> None:
        self._stated = stated
        self._whole = hashlib.md5(usedforsecurity=False)
        self._waiting: list[NDArray[np.uint16]] = []
        self._rows = 0

    def add(self, rows: NDArray[np.uint16]) -> None:
        if not self._stated.tiled:
            self._whole.update(rows.astype("<u2").tobytes())
            return
        self._waiting.append(rows)
        self._rows += len(rows)
        while self._rows >= _TILE_PX:
            together = np.concatenate(self._waiting)
            self._add_tiles(together[:_TILE_PX])
            self._waiting, self._rows = [together[_TILE_PX:]], len(together) - _TILE_PX

    def matches(self) -> bool:
        if self._rows:
            self._add_tiles(np.concatenate(self._waiting))
            self._waiting, self._rows = [], 0
        found, stated = self._whole.digest(), self._stated
        if found == stated.value or stated.tiled:
            return found == stated.value
        rest = slice(_SPOILT_BYTES, None)
        return stated.value.startswith(_SPOILT_START) or found[rest] == stated.value[rest]

    def _add_tiles(self, rows: NDArray[np.uint16]) -> None:
        kind = np.uint8 if self._stated.bytewise else np.dtype("<u2")
        for left in range(0, rows.shape[1], _TILE_PX):
            tile = rows[:, left : left + _TILE_PX].astype(kind).tobytes()
            self._whole.update(hashlib.md5(tile, usedforsecurity=False).digest())


# Of uncompressed rows: few enough that they stay in the processor's cache while they are looked at.
_BAND_ROWS: Final = 32
_MOST_RUNS: Final = 1000


@dataclass(frozen=True)
class ImageDescription:
    """One image of a file: how it is stored and what its samples mean."""

    header: FrameHeader
    layout: layouts.Layout
    visible: layouts.Area
    black: layouts.BlackLevels
    table: NDArray[np.uint16] | None
    digest: StatedDigest | None


def describe_dng(raw: tiff.Directory, main: tiff.Directory, file_size: int) -> ImageDescription:
    _refuse_lossy(raw)
    _refuse_hidden_mosaic(raw)
    layout = layouts.read_layout(raw, file_size)
    if layout.samples != 1:
        raise files.UNSUPPORTED_LAYOUT.refuse(f"The raw image has {layout.samples} samples per pixel.")
    if layout.compression not in segments.COMPRESSIONS:
        message = f"The raw image is compressed by method {layout.compression}."
        raise files.UNSUPPORTED_COMPRESSION.refuse(message)
    return _describe(raw, main, layout, cfa=layouts.read_cfa(raw), container="dng")


def describe_tiff(image: tiff.Directory, file_size: int) -> ImageDescription:
    _refuse_hidden_mosaic(image)
    if image.integer(tags.COMPRESSION, tags.UNCOMPRESSED) not in set(segments.COMPRESSIONS) - {tags.JPEG}:
        raise files.UNSUPPORTED_COMPRESSION.refuse("The TIFF's compression is not read.")
    layout = layouts.read_layout(image, file_size)
    rgb = image.integer(tags.PHOTOMETRIC, -1) == tags.PHOTOMETRIC_RGB
    if layout.bits not in (8, 16) or layout.samples != (3 if rgb else 1):
        raise files.UNSUPPORTED_LAYOUT.refuse(
            f"The TIFF has {layout.samples} samples of {layout.bits} bits per pixel: neither grey nor RGB."
        )
    return _describe(image, image, layout, cfa="rgb" if rgb else "grey", container="tiff")


def _describe(
    image: tiff.Directory, main: tiff.Directory, layout: layouts.Layout, *, cfa: str, container: str
) -> ImageDescription:
    uneven = layout.predictor == 2 and layout.samples * layout.bits not in (8, 16, 24, 48)
    if uneven or layout.predictor not in (1, 2):
        message = "The image is compressed with a predictor that is not read."
        raise files.UNSUPPORTED_COMPRESSION.refuse(message)
    dng = container == "dng"
    whole = layouts.Area(0, 0, layout.rows, layout.cols)
    visible = layouts.read_visible_area(image, layout.rows, layout.cols) if dng else whole
    black = layouts.read_black_levels(
        image, height=visible.height, width=visible.width, samples=layout.samples
    )
    table = layouts.read_linearization(image) if dng else None
    white, white_origin = layouts.read_white_levels(
        image, samples=layout.samples, bits=layout.bits, table=table
    )
    cell = 1 if cfa in ("grey", "rgb") else 2
    band = dialects.read_multispectral(main, bits=layout.bits) if cfa == "grey" else None
    if band is not None and band.full_scale_dn is not None and white_origin == "default":
        white, white_origin = (band.full_scale_dn,), "camera"
    if band is not None and band.black_dn is not None and black.origin == "default":
        black = replace(black, pattern=np.full((1, 1, 1), band.black_dn), origin="camera")
    stated = metadata.read_metadata(main)
    header = FrameHeader(
        container=container,
        decoder="stilb",
        # Multispectral cameras write raw samples as TIFF; their XMP or a black level tells them from others.
        rendered=not dng and band is None and tags.BLACK_LEVEL not in image,
        compression=segments.COMPRESSIONS[layout.compression],
        bits_per_sample=layout.bits,
        width_px=visible.width,
        height_px=visible.height,
        cfa=cfa,
        black_level_dn=black.mean_over(0, 0, visible.height, visible.width, cell=cell),
        black_level_origin=black.origin,
        white_level_dn=white * cell**2,
        white_level_origin=white_origin,
        opcodes=layouts.read_opcodes(image),
        multispectral=band,
        band_rows=layout.band_rows,
        first_band_rows=layout.band_rows - visible.top % layout.band_rows,
        **(stated | {"serial": stated["serial"] or (band.imager_serial if band is not None else None)}),
    )
    digest = read_digest(image, main, bits=layout.bits) if dng else None
    return ImageDescription(header, layout, visible, black, table, digest)


def _refuse_lossy(raw: tiff.Directory) -> None:
    compression = raw.integer(tags.COMPRESSION, tags.UNCOMPRESSED)
    linear = raw.integer(tags.PHOTOMETRIC, -1) == tags.PHOTOMETRIC_LINEAR_RAW
    # with one sample a pixel it is the image of a monochrome sensor
    if linear and raw.integer(tags.SAMPLES_PER_PIXEL, 1) > 1:
        raise files.LINEAR_RAW.refuse("The DNG holds an interpolated colour image, not the sensor's mosaic.")
    if compression == tags.LOSSY_JPEG:
        raise files.LOSSY_DNG.refuse("The DNG is compressed with loss.")
    if compression == tags.JPEG_XL:
        raise files.UNSUPPORTED_COMPRESSION.refuse("The DNG is compressed with JPEG XL.")


def _refuse_hidden_mosaic(image: tiff.Directory) -> None:
    """Refuse a mosaic whose directory was changed to that of a grey image: its colours would be mixed."""
    if tags.CFA_PATTERN in image and image.integer(tags.PHOTOMETRIC, -1) != tags.PHOTOMETRIC_CFA:
        raise files.UNSUPPORTED_LAYOUT.refuse(
            "The file states a colour pattern (CFAPattern), and an image that is no mosaic of colours "
            "(PhotometricInterpretation)."
        )


class NativeFile:
    def __init__(self, source: tiff.Source, description: ImageDescription, allow: limits.Allow) -> None:
        self._source, self._allow, self._image = source, allow, description
        self._libraw: LibRawFile | None = None
        self._consumed: dict[int, int] = {}
        self.header = description.header

    def read(self, row0: int, col0: int, height: int, width: int) -> NDArray[np.uint16]:
        image = self._image
        top, left = image.visible.top + row0, image.visible.left + col0
        if self._libraw is not None:
            return self._libraw.mosaic[top : top + height, left : left + width]
        try:
            samples = segments.read_samples(self._source, image.layout, top, left, height, width)
        except ljpeg.NotDecodedHereError:
            self._hand_to_libraw()
            return self.read(row0, col0, height, width)
        return self._linearise(samples)

    @property
    def lowest_dn(self) -> float:
        """Return what a sample of zero means."""
        return 0.0 if self._image.table is None else float(self._image.table[0])

    def bands(self) -> Iterator[tuple[int, NDArray[np.uint16]]]:
        """Every visible row from the top, in bands, each with the first row's number."""
        image, layout, visible = self._image, self._image.layout, self._image.visible
        whole = image.digest is not None or layout.compression != tags.UNCOMPRESSED
        area = layouts.Area(0, 0, layout.rows, layout.cols) if whole else visible
        digest = DigestCheck(image.digest) if image.digest else None
        piece = 1 if layout.compression == tags.UNCOMPRESSED else layout.segment_rows
        step = piece * -(-_BAND_ROWS // piece)
        top = area.top
        while top < area.bottom:
            bottom = min(area.bottom, (top // step + 1) * step)
            try:
                samples = segments.read_samples(
                    self._source, self._image.layout, top, area.left, bottom - top, area.width, self._consumed
                )
            except ljpeg.NotDecodedHereError as error:
                if self._consumed:
                    # no writer changes its way from piece to piece
                    message = "A piece of the image is coded unlike the others."
                    raise files.INCOMPLETE_IMAGE.refuse(message) from error
                self._hand_to_libraw()
            if self._libraw is not None:
                rest = max(top, visible.top) - visible.top
                if rest < visible.height:
                    yield rest, self.read(rest, 0, visible.height - rest, visible.width)
                return
            if digest is not None:
                digest.add(samples[:, :, 0])
            first, last = max(top, visible.top), min(bottom, visible.bottom)
            if first < last:
                seen = samples[first - top : last - top, visible.left - area.left : visible.right - area.left]
                yield first - visible.top, self._linearise(seen)
            top = bottom
        if digest is not None and not digest.matches():
            message = "The file's own digest of its raw image is not that of its pixels."
            raise files.INCOMPLETE_IMAGE.refuse(message)

    def vouch(self) -> tuple[proof.Voucher, tuple[proof.PieceRun, ...]]:
        """Return what proves the samples whole, after all bands have been read."""
        layout = self._image.layout
        if self._libraw is not None:
            return "libraw", ()
        stored = layout.byte_counts.tolist()
        took = [self._consumed.get(index, stored[index]) for index in range(len(stored))]
        across = layout.segment_cols * layout.samples
        runs: list[proof.PieceRun] = []
        held = (layout.rows_in(index // layout.across) * across for index in range(len(stored)))
        for (one, used, samples), group in itertools.groupby(zip(stored, took, held, strict=True)):
            count = sum(1 for _ in group)
            runs.append(proof.PieceRun(pieces=count, stored_bytes=one, consumed_bytes=used, samples=samples))
            if len(runs) == _MOST_RUNS:
                break
        return ("digest" if self._image.digest else segments.VOUCHERS[layout.compression]), tuple(runs)

    def _linearise(self, samples: NDArray[np.uint16]) -> NDArray[np.uint16]:
        linear = samples if self._image.table is None else np.take(self._image.table, samples)
        return linear[:, :, 0] if self._image.layout.samples == 1 else linear

    def black_level(self, row0: int, col0: int, height: int, width: int) -> tuple[float, ...]:
        cell = 1 if self.header.cfa in ("grey", "rgb") else 2
        return self._image.black.mean_over(row0, col0, height, width, cell=cell)

    def _hand_to_libraw(self) -> None:
        """Only the decoding changes hands: levels and metadata are still the file's own."""
        libraw = LibRawFile(self._source, self._allow, self._image.visible)
        if libraw.mosaic.shape != (self._image.layout.rows, self._image.layout.cols):
            raise files.UNSUPPORTED_LAYOUT.refuse("LibRaw sees an image of another size in this file.")
        self._libraw = libraw
        self.header = replace(self.header, decoder="libraw")
