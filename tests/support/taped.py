"""What a team brings home: a card with a taped rectangle at five levels in the dark room; and a lit street.

One light frame is spoilt: somebody walked through the light. The frames lie in a folder a scene.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tests.support.frames import write_frame

K_TRUE = 30.0
ISOS = (100, 400)
LEVELS = {"level-1": 60.0, "level-2": 24.0, "level-3": 8.0, "level-4": 3.0, "level-5": 1.2}
SHAPE = (288, 432)
# what the tape frames, (row0, row1), (col0, col1), and a region well inside it, (x, y)
TAPED = ((80, 208), (128, 304))
REGION = ((140.0, 92.0), (292.0, 92.0), (292.0, 196.0), (140.0, 196.0))
SPOILT = "level-3-iso-400-f-5.6.DNG"
ROAD = ((120.0, 96.0), (312.0, 96.0), (408.0, 264.0), (24.0, 264.0))
_SPOILT_SHARE = 0.86
# (row, column, size) of the light below each lamp
_POOLS = ((232, 110, 60), (190, 300, 44), (158, 160, 32), (134, 264, 23), (116, 192, 16))
# at ISO 100: nothing clips at f/4, and X spans more than a decade
_TIMES_S = {"level-1": 0.2, "level-2": 0.25, "level-3": 0.5, "level-4": 1.0, "level-5": 1.0}
_F_NUMBERS = (4.0, 5.6)
_DN_PER_ELECTRON = 0.25
# by how much a meter errs at each level and an aperture at each marking: the same in every frame of theirs
_READINGS = {"level-1": 1.006, "level-2": 0.993, "level-3": 1.004, "level-4": 0.992, "level-5": 1.005}
_REPEATED = (0.997, 1.003)
_OPENED = {4.0: 1.004, 5.6: 0.993}


def write_night(folder: Path) -> Path:
    """Every frame of the calibration: a folder a level, and one of dark frames."""
    for number, (iso, level) in enumerate((iso, level) for iso in ISOS for level in LEVELS):
        for f_number in _F_NUMBERS:
            name = f"{level}-iso-{iso}-f-{f_number:g}.DNG"
            seen = LEVELS[level] * (_SPOILT_SHARE if name == SPOILT else 1.0)
            seed = 100 * number + round(f_number)
            _take(folder / level / name, seen * _look_at_card(), level, f_number, iso, seed=seed)
        _take(folder / "dark" / f"dark-iso-{iso}-{level}.DNG", np.zeros(SHAPE), level, 4.0, iso, seed=number)
    return folder


def write_street(path: Path) -> Path:
    """Pools of light below the lamps of a street, getting smaller towards the horizon."""
    row, col = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float)
    luminance = np.full(SHAPE, 0.03)
    for at_row, at_col, size in _POOLS:
        distance2 = ((row - at_row) / (0.45 * size)) ** 2 + ((col - at_col) / (1.5 * size)) ** 2
        luminance += 1.6 * np.exp(-distance2)
    luminance[row < 92] = 0.01
    return _take(path, luminance, "level-5", 4.0, 400, seed=99)


def paste_readings() -> str:
    """As it comes out of a spreadsheet's cells."""
    rows = [
        (level, value * _READINGS[level] * factor) for level, value in LEVELS.items() for factor in _REPEATED
    ]
    return "\n".join(f"{level}\t{value:.4g}" for level, value in rows)


def _look_at_card() -> NDArray[np.float64]:
    """The light of a wall, a card on it, and the tape on the card, as shares of that within the tape."""
    row, col = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float)
    seen = 0.35 * (1.2 - ((row - 100) / 400) ** 2 - ((col - 300) / 500) ** 2)
    seen[40:248, 72:360] = 1.0
    (top, bottom), (left, right) = TAPED
    seen[top - 8 : bottom + 8, left - 8 : right + 8] = 0.12
    seen[top:bottom, left:right] = 1.0
    return seen


def _take(
    path: Path, luminance: NDArray[np.float64], level: str, f_number: float, iso: int, *, seed: int
) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    exposure_time_s = _TIMES_S[level] * 100 / iso
    signal_dn = K_TRUE * _OPENED[f_number] * exposure_time_s * iso * luminance / f_number**2
    noise_dn = np.sqrt(4.0 + _DN_PER_ELECTRON * iso / 100 * signal_dn)
    return write_frame(
        path,
        signal_dn=signal_dn,
        noise_dn=noise_dn,
        exposure_time_s=exposure_time_s,
        f_number=f_number,
        iso=iso,
        seed=seed,
        shape=SHAPE,
    )
