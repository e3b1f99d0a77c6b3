"""Opening of a file by its bytes: which kind it is, and whether it is one at all."""

from collections.abc import Iterator
from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected, files
from radiometry.frame import FrameHeader
from radiometry.frame.proof import PieceRun, Voucher
from worker.decode import tags
from worker.decode.budget import Allow
from worker.decode.layout import read_layout
from worker.decode.libraw import LibRawFile
from worker.decode.metadata import Metadata, read_metadata
from worker.decode.native import NativeFile, describe_dng, describe_tiff
from worker.decode.pictures import PictureFile, is_picture
from worker.decode.source import Source
from worker.decode.table import MAGIC, TableFile
from worker.decode.tiff import Directory, is_tiff, read_directories

_KNOWN_OTHERS: Final = (
    (b"%PDF", "a PDF document"),
    (b"PK\x03\x04", "a ZIP archive"),
    (b"GIF8", "a GIF picture"),
    (b"II+\0", "a BigTIFF"),
    (b"MM\0+", "a BigTIFF"),
)
# How files begin that LibRaw reads and that are no TIFF: Canon, Fuji, Minolta, Olympus, Panasonic, Sigma.
_RAW_MAGIC: Final = (b"FUJIFILM", b"\0MRM", b"IIRO", b"IIRS", b"MMOR", b"IIU\0", b"II\x1a\0", b"FOVb")


class OtherRawFile:
    """A file that only LibRaw reads."""

    band_rows = 1 << 16

    def __init__(self, libraw: LibRawFile, metadata: Metadata | None) -> None:
        self._libraw = libraw
        self.header = libraw.header(metadata)

    def read(self, row0: int, col0: int, height: int, width: int) -> NDArray[np.uint16]:
        top, left = self._libraw.visible.top + row0, self._libraw.visible.left + col0
        return self._libraw.mosaic[top : top + height, left : left + width]

    lowest_dn = 0.0

    def bands(self) -> Iterator[tuple[int, NDArray[np.uint16]]]:
        """The visible rows, which LibRaw has decoded in one go."""
        yield 0, self.read(0, 0, self.header.height_px, self.header.width_px)

    def vouch(self) -> tuple[Voucher, tuple[PieceRun, ...]]:
        """LibRaw does not say how it read what it read."""
        return "libraw", ()

    def black_level(self, *_window: int) -> tuple[float, ...]:
        return self.header.black_level_dn


OpenedFile = NativeFile | OtherRawFile | PictureFile | TableFile


def open_source(source: Source, allow: Allow) -> OpenedFile:
    """``allow`` : is told of a frame's size before anything of that size is allocated."""
    opened = _open(source, allow)
    _check_levels(opened.header)
    return opened


def _check_levels(header: FrameHeader) -> None:
    for black_dn, white_dn in zip(header.black_level_dn, header.white_level_dn, strict=True):
        if black_dn >= white_dn:
            raise files.LEVELS_CONTRADICTORY.refuse(
                f"The file's black level of {black_dn:g} DN is not below its white level of {white_dn:g} DN."
            )


def _open(source: Source, allow: Allow) -> OpenedFile:
    if not len(source):
        raise files.EMPTY_FILE.refuse("The file is empty.")
    head = source[:16]
    if is_tiff(head):
        return _open_tiff(source, allow)
    if head.startswith(MAGIC):
        return TableFile(source)
    if is_picture(head):
        return _allowed(PictureFile(source), allow)
    if head.startswith(_RAW_MAGIC) or head[4:12] == b"ftypcrx ":
        return OtherRawFile(LibRawFile(source, allow), None)
    known = next((name for magic, name in _KNOWN_OTHERS if head.startswith(magic)), "no raw image")
    raise files.NOT_A_RAW_FILE.refuse(f"The file is {known}, whatever its name says.")


def _open_tiff(source: Source, allow: Allow) -> OpenedFile:
    directories = read_directories(source)
    main = directories[0]
    if tags.DNG_VERSION in main:
        raw = _find_raw(directories)
        return _allowed(NativeFile(source, describe_dng(raw, main, len(source)), allow), allow)
    is_cfa = any(_photometric(each) == tags.PHOTOMETRIC_CFA for each in directories)
    canon = source[8:10] == b"CR"
    if not is_cfa and not canon and _is_picture(main):
        return _allowed(NativeFile(source, describe_tiff(main, len(source)), allow), allow)
    _refuse_cut_mosaics(directories, len(source))
    return OtherRawFile(LibRawFile(source, allow), read_metadata(main))


_Opened = TypeVar("_Opened", NativeFile, PictureFile)


def _allowed(opened: _Opened, allow: Allow) -> _Opened:
    """The file, of which only the header has been read yet."""
    header = opened.header
    allow(header.height_px * header.width_px * (3 if header.cfa == "rgb" else 1))
    return opened


def _photometric(directory: Directory) -> int:
    return directory.integer(tags.PHOTOMETRIC, -1)


def _is_picture(directory: Directory) -> bool:
    reduced = directory.integer(tags.NEW_SUBFILE_TYPE, 0) & 1
    known = _photometric(directory) in (tags.PHOTOMETRIC_GREY, tags.PHOTOMETRIC_RGB)
    return not reduced and known


def _find_raw(directories: list[Directory]) -> Directory:
    """The full-size image of a DNG: the mosaic, or what a converter left in its place."""
    full = [each for each in directories if not each.integer(tags.NEW_SUBFILE_TYPE, 0) & 1]
    for wanted in (tags.PHOTOMETRIC_CFA, tags.PHOTOMETRIC_LINEAR_RAW, tags.PHOTOMETRIC_GREY):
        for directory in full:
            if _photometric(directory) == wanted and tags.IMAGE_WIDTH in directory:
                return directory
    raise files.NOT_A_RAW_FILE.refuse("The DNG holds previews but no raw image.")


def _refuse_cut_mosaics(directories: list[Directory], file_size: int) -> None:
    """LibRaw reads zeros for what is missing, so what the directories claim is checked before it is asked."""
    for directory in directories:
        if _photometric(directory) != tags.PHOTOMETRIC_CFA:
            continue
        try:
            read_layout(directory, file_size)
        except InputRejected as refusal:
            # Other makers' layouts are LibRaw's business; only what is missing or too large is decided here.
            if refusal.code in (files.TRUNCATED, files.FRAME_TOO_LARGE):
                raise
