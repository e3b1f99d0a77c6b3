"""The digests of the raw image that a DNG may carry, computed as the image's rows come.

RawImageDigest is defined in the DNG specification: MD5 over the pixels in row order, each as 16 bits, the low
byte first. NewRawImageDigest is defined, as the specification says, by the source of Adobe's DNG SDK
(`dng_negative::FindNewRawImageDigest`): MD5 over the MD5 of each tile of 256 x 256 pixels, row by row, cut at
the right and the bottom; 8 bits a pixel where the image or its linearization table has no more, else 16, the
low byte first. Both are of the whole image with its masked borders, before linearization.
"""

import hashlib
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from worker.decode import tags
from worker.decode.tiff import Directory

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


def read_digest(raw: Directory, main: Directory, *, bits: int) -> StatedDigest | None:
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
        """Take the next rows (row, col)."""
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
        """Return True if the rows are those that the digest was made of."""
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
