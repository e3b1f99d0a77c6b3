"""The three things that are asked of a file: its header, a window of its mosaic, a picture to draw on."""

import json
import operator
from typing import Any, Final, NamedTuple, TypeVar

import imagecodecs
import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected, files, shared
from radiometry.frame import Frame, FrameHeader, TableRow
from radiometry.frame.proof import PieceRun, Proof, Voucher, WholenessCheck
from worker.decode import layout, limits, native, pictures, tags, tiff
from worker.decode.libraw import LibRawFile
from worker.decode.metadata import read_metadata

_GAMMA = 1 / 2.2
_BRIGHT_PERCENTILE = 99.7
_MAX_SIDE_PX = 4096


class PreviewMaker:
    """Makes an 8 bit PNG of the frame's rows as they come, from the top."""

    def __init__(self, header: FrameHeader, longest_side_px: int) -> None:
        longest = max(16, min(longest_side_px, _MAX_SIDE_PX))
        scale = max(1.0, max(header.height_px, header.width_px) / longest)
        self._cell = 1 if header.cfa in ("grey", "rgb") else 2
        self._rows = _sampled(header.height_px, scale, self._cell)
        self._cols = _sampled(header.width_px, scale, self._cell)
        self._black = float(np.mean(header.black_level_dn))
        self._grey = np.zeros((len(self._rows), len(self._cols)), np.float32)

    def add(self, row0: int, samples: NDArray[np.uint16]) -> None:
        """Take of the next rows what the preview shows of them; a cell may lie in two calls."""
        if samples.ndim == 3:
            samples = samples[:, :, 1]  # green stands for brightness
        for phase in range(self._cell):
            first, last = np.searchsorted(self._rows + phase, (row0, row0 + len(samples)))
            lines = samples[self._rows[first:last] + phase - row0]
            for col_phase in range(self._cell):
                self._grey[first:last] += lines[:, self._cols + col_phase]

    def finish(self) -> bytes:
        self._grey /= self._cell**2
        bright = max(float(np.percentile(self._grey, _BRIGHT_PERCENTILE)), self._black + 1.0)
        share = np.clip((self._grey - self._black) / (bright - self._black), 0.0, 1.0)
        return bytes(imagecodecs.png_encode(np.asarray(np.round(255 * share**_GAMMA), np.uint8), level=1))


def _sampled(size: int, scale: float, cell: int) -> NDArray[np.int64]:
    """The first line of the cell at the middle of each preview line."""
    count = max(1, round(size / scale))
    middles = ((np.arange(count) + 0.5) * size / count).astype(np.int64)
    first = np.minimum(middles, size - cell)
    return np.asarray(first // cell * cell if scale >= cell else first, np.int64)


MAGIC: Final = b'{"stilb_row": 1,'
_MOST_BYTES: Final = 10_000
_STATED: Final = ("mean_dn", "min_dn", "max_dn", "white_level_dn")
_IF_KNOWN: Final = ("std_dn", "black_level_dn")


class TableFile(pictures.WholeFile):
    """A row, with one pixel of its mean for a preview to show."""

    def __init__(self, source: tiff.Source) -> None:
        try:
            said = json.loads(bytes(source[:_MOST_BYTES]))
            stated = [*_STATED, *(name for name in _IF_KNOWN if said.get(name) is not None)]
            pixels = operator.index(said["pixels"])
            row = TableRow(pixels=pixels, **{name: float(said[name]) for name in stated})
        except (KeyError, TypeError, ValueError, OverflowError, RecursionError) as error:
            raise files.SIZE_MISMATCH.refuse("The row of a table is not one that stilb wrote.") from error
        if not row.is_possible:
            raise files.SIZE_MISMATCH.refuse("No samples have the statistics of this row.")
        self.header = FrameHeader(
            container="table",
            decoder="stilb",
            rendered=False,
            compression="none",
            bits_per_sample=16,
            width_px=1,
            height_px=1,
            cfa="grey",
            black_level_dn=(row.black_level_dn or 0.0,),
            black_level_origin="supplied" if "black_level_dn" in stated else "default",
            white_level_dn=(row.white_level_dn,),
            white_level_origin="supplied",
            table=row,
        )
        self._pixel = np.full((1, 1), min(max(1, round(row.mean_dn)), 65535), np.uint16)

    def read(self, row0: int, col0: int, height: int, width: int) -> NDArray[np.uint16]:
        return self._pixel[row0 : row0 + height, col0 : col0 + width]

    def vouch(self) -> tuple[Voucher, tuple[PieceRun, ...]]:
        return "length", ()  # no pixel is there to be proved


_KNOWN_OTHERS: Final = (
    (b"%PDF", "a PDF document"),
    (b"PK\x03\x04", "a ZIP archive"),
    (b"GIF8", "a GIF picture"),
    (b"II+\0", "a BigTIFF"),
    (b"MM\0+", "a BigTIFF"),
)
# How files begin that LibRaw reads and that are no TIFF: Canon, Fuji, Minolta, Olympus, Panasonic, Sigma.
_RAW_MAGIC: Final = (b"FUJIFILM", b"\0MRM", b"IIRO", b"IIRS", b"MMOR", b"IIU\0", b"II\x1a\0", b"FOVb")


class OtherRawFile(pictures.WholeFile):
    """A file that only LibRaw reads."""

    def __init__(self, libraw: LibRawFile, metadata: dict[str, Any] | None) -> None:
        self._libraw = libraw
        self.header = libraw.header(metadata)

    def read(self, row0: int, col0: int, height: int, width: int) -> NDArray[np.uint16]:
        top, left = self._libraw.visible.top + row0, self._libraw.visible.left + col0
        return self._libraw.mosaic[top : top + height, left : left + width]

    def vouch(self) -> tuple[Voucher, tuple[PieceRun, ...]]:
        """LibRaw does not say how it read what it read."""
        return "libraw", ()


OpenedFile = native.NativeFile | OtherRawFile | pictures.PictureFile | TableFile


def open_source(source: tiff.Source, allow: limits.Allow) -> OpenedFile:
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


def _open(source: tiff.Source, allow: limits.Allow) -> OpenedFile:
    if not len(source):
        raise files.EMPTY_FILE.refuse("The file is empty.")
    head = source[:16]
    if tiff.is_tiff(head):
        return _open_tiff(source, allow)
    if head.startswith(MAGIC):
        return TableFile(source)
    if pictures.is_picture(head):
        return _allowed(pictures.PictureFile(source), allow)
    if head.startswith(_RAW_MAGIC) or head[4:12] == b"ftypcrx ":
        return OtherRawFile(LibRawFile(source, allow), None)
    known = next((name for magic, name in _KNOWN_OTHERS if head.startswith(magic)), "no raw image")
    raise files.NOT_A_RAW_FILE.refuse(f"The file is {known}, whatever its name says.")


def _open_tiff(source: tiff.Source, allow: limits.Allow) -> OpenedFile:
    directories = tiff.read_directories(source)
    main = directories[0]
    if tags.DNG_VERSION in main:
        raw = _find_raw(directories)
        return _allowed(native.NativeFile(source, native.describe_dng(raw, main, len(source)), allow), allow)
    is_cfa = any(_photometric(each) == tags.PHOTOMETRIC_CFA for each in directories)
    canon = source[8:10] == b"CR"
    reduced = main.integer(tags.NEW_SUBFILE_TYPE, 0) & 1
    grey_or_rgb = _photometric(main) in (tags.PHOTOMETRIC_GREY, tags.PHOTOMETRIC_RGB)
    if not is_cfa and not canon and not reduced and grey_or_rgb:
        return _allowed(native.NativeFile(source, native.describe_tiff(main, len(source)), allow), allow)
    _refuse_cut_mosaics(directories, len(source))
    return OtherRawFile(LibRawFile(source, allow), read_metadata(main))


_Opened = TypeVar("_Opened", native.NativeFile, pictures.PictureFile)


def _allowed(opened: _Opened, allow: limits.Allow) -> _Opened:
    """The file, of which only the header has been read yet."""
    header = opened.header
    allow(header.height_px * header.width_px * (3 if header.cfa == "rgb" else 1))
    return opened


def _photometric(directory: tiff.Directory) -> int:
    return directory.integer(tags.PHOTOMETRIC, -1)


def _find_raw(directories: list[tiff.Directory]) -> tiff.Directory:
    """The full-size image of a DNG: the mosaic, or what a converter left in its place."""
    full = [each for each in directories if not each.integer(tags.NEW_SUBFILE_TYPE, 0) & 1]
    for wanted in (tags.PHOTOMETRIC_CFA, tags.PHOTOMETRIC_LINEAR_RAW, tags.PHOTOMETRIC_GREY):
        for directory in full:
            if _photometric(directory) == wanted and tags.IMAGE_WIDTH in directory:
                return directory
    raise files.NOT_A_RAW_FILE.refuse("The DNG holds previews but no raw image.")


def _refuse_cut_mosaics(directories: list[tiff.Directory], file_size: int) -> None:
    """LibRaw reads zeros for what is missing, so what the directories claim is checked before it is asked."""
    for directory in directories:
        if _photometric(directory) != tags.PHOTOMETRIC_CFA:
            continue
        try:
            layout.read_layout(directory, file_size)
        except InputRejected as refusal:
            # Other makers' layouts are LibRaw's business; only what is missing or too large is decided here.
            if refusal.code in (files.TRUNCATED, files.FRAME_TOO_LARGE):
                raise


# In a picture to look at, black is a colour like others; it proves itself whole otherwise.
_PICTURES: Final = frozenset({"jpeg", "png", "table"})


class Window(NamedTuple):
    """Rows and columns of the visible area."""

    row0: int
    col0: int
    height: int
    width: int


class Reader:
    """Reads one file, which is opened and parsed when it is first asked for."""

    def __init__(self, source: tiff.Source, allow: limits.Allow = limits.allow_all) -> None:
        self._source, self._allow = source, allow
        self._opened: OpenedFile | None = None

    def read_header(self) -> FrameHeader:
        return self._open().header

    def read_window(self, window: Window) -> Frame:
        opened = self._open()
        header = opened.header
        _check_inside(window, header)
        samples = opened.read(*window)
        return Frame(
            samples_dn=np.ascontiguousarray(samples),
            row0=window.row0,
            col0=window.col0,
            height_px=header.height_px,
            width_px=header.width_px,
            cfa=header.cfa,
            black_level_dn=opened.black_level(*window),
            white_level_dn=header.white_level_dn,
        )

    def inspect(self, longest_side_px: int) -> tuple[bytes, Proof]:
        """Read every row of a frame once: its preview as a PNG, and its proof."""
        opened = self._open()
        header = opened.header
        preview = PreviewMaker(header, longest_side_px)
        check = WholenessCheck(
            height_px=header.height_px,
            width_px=header.width_px,
            channels=3 if header.cfa == "rgb" else 1,
            black_dn=min(header.black_level_dn),
            lowest_dn=opened.lowest_dn,
            doubts_black=header.container not in _PICTURES,
            rendered=header.rendered,
        )
        highest_dn = 0
        for row0, samples in opened.bands():
            check.add(row0, samples)
            highest_dn = max(highest_dn, int(samples.max()))
            preview.add(row0, samples)
        vouched_by, pieces = opened.vouch()
        proof = Proof(vouched_by=vouched_by, pieces=pieces, wholeness=check.conclude(), highest_dn=highest_dn)
        return preview.finish(), proof

    def _open(self) -> OpenedFile:
        if self._opened is None:
            self._opened = open_source(self._source, self._allow)
        return self._opened


def _check_inside(window: Window, header: FrameHeader) -> None:
    row_end, col_end = window.row0 + window.height, window.col0 + window.width
    fits = row_end <= header.height_px and col_end <= header.width_px
    if not (fits and min(window) >= 0 and window.height > 0 and window.width > 0):
        raise shared.ROI_OUTSIDE_FRAME.reject(
            f"The region reaches beyond the image's {header.width_px} x {header.height_px} pixels. "
            "Draw it inside the image."
        )
