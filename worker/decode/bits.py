"""Samples of 8 to 16 bits, packed without gaps from the most significant bit on, as TIFF and DNG lay them."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray


def unpack_rows(packed: NDArray[np.uint8], *, bits: int, first: int, count: int) -> NDArray[np.uint16]:
    """Samples [first, first + count) of every row.

    packed : (row, byte) uint8, each row starting with sample 0 on a byte of its own
    """
    period = 8 // math.gcd(8, bits)  # samples after which the pattern of bytes repeats
    period_bytes = period * bits // 8
    start = first // period
    stop = -(-(first + count) // period)
    chunk = packed[:, start * period_bytes : stop * period_bytes]
    missing = (stop - start) * period_bytes - chunk.shape[1]
    if missing > 0:
        # The last row of a strip ends with its own last byte, in the middle of a pattern.
        chunk = np.pad(chunk, ((0, 0), (0, missing)))
    groups = chunk.reshape(len(packed), stop - start, period_bytes)
    samples = np.empty((len(packed), stop - start, period), np.uint16)
    for index in range(period):
        samples[:, :, index] = _sample(groups, index * bits, bits)
    skip = first - start * period
    return samples.reshape(len(packed), -1)[:, skip : skip + count]


def _sample(groups: NDArray[np.uint8], at_bit: int, bits: int) -> NDArray[np.uint16]:
    first_byte, last_byte = at_bit // 8, (at_bit + bits - 1) // 8
    # the narrower the word, the quicker: only 11 bits and more may lie in three bytes
    kind: type[np.uint16 | np.uint32] = np.uint16 if last_byte - first_byte <= 1 else np.uint32
    word: NDArray[Any] = groups[:, :, first_byte].astype(kind)
    for byte in range(first_byte + 1, last_byte + 1):
        word = (word << 8) | groups[:, :, byte]
    aligned = word >> ((last_byte + 1) * 8 - at_bit - bits)
    return np.asarray(aligned & ((1 << bits) - 1), np.uint16)
