"""Limits that no honest frame exceeds; all are checked before anything is allocated."""

from radiometry.findings import files

MAX_SIDE_PX = 65_535
MAX_FRAME_PX = 250_000_000
MIN_SIDE_PX = 16
MAX_TAGS = 2_000  # in one directory
MAX_DIRECTORIES = 32
MAX_DIRECTORY_DEPTH = 3
MAX_SEGMENTS = 1 << 20
MAX_OPCODES = 256
MAX_TEXT = 200

# A tile may overhang a small frame, but not by much more than tiles are large.
_SMALL_SEGMENT_PX = 1 << 22


def check_frame_size(rows: int, cols: int) -> None:
    if rows < MIN_SIDE_PX or cols < MIN_SIDE_PX:
        raise files.FRAME_TOO_SMALL.refuse(f"The image has only {cols} x {rows} pixels.")
    if max(rows, cols) > MAX_SIDE_PX or rows * cols > MAX_FRAME_PX:
        limit = MAX_FRAME_PX // 1_000_000
        raise files.FRAME_TOO_LARGE.refuse(
            f"The file claims {cols} x {rows} pixels, above the limit of {limit} megapixels.",
        )


def check_backed(claimed: float, held: float) -> None:
    """Refuse a claim that what the file holds cannot back, however well it was compressed."""
    if claimed > held:
        raise files.SIZE_MISMATCH.refuse("The file claims an image far larger than its data can hold.")


def check_segment_size(segment_px: int, frame_px: int) -> None:
    if segment_px > max(4 * frame_px, _SMALL_SEGMENT_PX):
        raise files.FRAME_TOO_LARGE.refuse("The file claims tiles that are far larger than its image.")


def check_segment_count(count: int) -> None:
    if count > MAX_SEGMENTS:
        raise files.FRAME_TOO_LARGE.refuse(f"The file cuts its image into {count} pieces.")
