"""Black and white levels, kept per CFA site and exact for any window."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import files
from worker.decode import tags
from worker.decode.tiff import Directory

_MAX_REPEAT = 64


@dataclass(frozen=True)
class BlackLevels:
    """Level(row, col) = pattern[row % R, col % C] + per_row[row] + per_col[col], from the visible corner."""

    pattern: NDArray[np.float64]  # (R, C, sample)
    per_row: NDArray[np.float64]  # BlackLevelDeltaV
    per_col: NDArray[np.float64]  # BlackLevelDeltaH
    origin: str

    def mean_over(self, row0: int, col0: int, height: int, width: int, *, cell: int) -> tuple[float, ...]:
        """The window's mean for each site of a ``cell`` x ``cell`` cell, row by row; per sample for RGB."""
        means: list[float] = []
        for row_phase in range(cell):
            rows = _matching(row0, height, row_phase, cell)
            for col_phase in range(cell):
                cols = _matching(col0, width, col_phase, cell)
                means.extend(self._mean(rows, cols).tolist())
        return tuple(means)

    def _mean(self, rows: NDArray[np.int64], cols: NDArray[np.int64]) -> NDArray[np.float64]:
        repeat_rows, repeat_cols, _ = self.pattern.shape
        row_share = np.bincount(rows % repeat_rows, minlength=repeat_rows) / len(rows)
        col_share = np.bincount(cols % repeat_cols, minlength=repeat_cols) / len(cols)
        level: NDArray[np.float64] = np.einsum("r,c,rcs->s", row_share, col_share, self.pattern)
        level += self.per_row[rows].mean() if len(self.per_row) else 0.0
        level += self.per_col[cols].mean() if len(self.per_col) else 0.0
        return level


def _matching(start: int, count: int, phase: int, cell: int) -> NDArray[np.int64]:
    """Indices of one phase; a window too narrow to hold any is answered for the phase's nearest line."""
    chosen: NDArray[np.int64] = np.arange(start + (phase - start) % cell, start + count, cell)
    if len(chosen):
        return chosen
    nearest = start - start % cell + phase
    return np.array([nearest - cell if nearest > start >= cell else nearest])


def read_black_levels(directory: Directory, *, height: int, width: int, samples: int) -> BlackLevels:
    repeat = directory.integers(tags.BLACK_LEVEL_REPEAT, at_most=2) or [1, 1]
    if len(repeat) != 2 or not all(1 <= side <= _MAX_REPEAT for side in repeat):
        raise files.UNSUPPORTED_LAYOUT.refuse("The file's black level pattern cannot be read.")
    values = _levels(directory, tags.BLACK_LEVEL, at_most=_MAX_REPEAT**2 * 4)
    if len(values) == 1:
        # Some writers give one value for a larger pattern.
        repeat, values = [1, 1], values * samples
    if values and len(values) != repeat[0] * repeat[1] * samples:
        raise files.UNSUPPORTED_LAYOUT.refuse(
            f"The file has {len(values)} black levels for a {repeat} pattern."
        )
    pattern = np.array(values or [0.0] * samples).reshape(*(repeat if values else (1, 1)), samples)
    return BlackLevels(
        pattern=pattern,
        per_row=_deltas(directory, tags.BLACK_LEVEL_DELTA_V, height),
        per_col=_deltas(directory, tags.BLACK_LEVEL_DELTA_H, width),
        origin="tag" if values else "default",
    )


def _deltas(directory: Directory, tag: int, expected: int) -> NDArray[np.float64]:
    values = np.array(_levels(directory, tag, at_most=expected))
    if len(values) not in (0, expected):
        raise files.SIZE_MISMATCH.refuse(
            f"The file has {len(values)} black level deltas for {expected} lines."
        )
    return values


def _levels(directory: Directory, tag: int, *, at_most: int) -> list[float]:
    values = directory.numbers(tag, at_most=at_most)
    stated = [float(value) for value in values if value is not None]
    if len(stated) != len(values):
        raise files.UNSUPPORTED_LAYOUT.refuse(f"The file's level in tag {tag} is no number.")
    return stated


def read_white_levels(
    directory: Directory, *, samples: int, bits: int, table: NDArray[np.uint16] | None
) -> tuple[tuple[float, ...], str]:
    """Per sample. Not stated: the largest value that can occur, which a linearisation table decides."""
    values = _levels(directory, tags.WHITE_LEVEL, at_most=16)
    if len(values) not in (0, 1, samples):
        raise files.UNSUPPORTED_LAYOUT.refuse(f"The file has {len(values)} white levels.")
    if values:
        return tuple(values * samples if len(values) == 1 else values), "tag"
    largest = float((1 << bits) - 1) if table is None else float(table.max())
    return (largest,) * samples, "default"


def read_linearization(directory: Directory) -> NDArray[np.uint16] | None:
    """A table with a value for every possible sample: the last entry stands for all beyond it."""
    entries = directory.integers(tags.LINEARIZATION_TABLE, at_most=1 << 16)
    if not entries:
        return None
    if min(entries) < 0 or max(entries) > 65_535:
        raise files.UNSUPPORTED_LAYOUT.refuse("The file's linearization table leaves the 16 bit range.")
    table = np.full(1 << 16, entries[-1], np.uint16)
    table[: len(entries)] = entries
    return table
