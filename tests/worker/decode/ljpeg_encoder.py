"""A lossless JPEG (SOF3) encoder for the tests: every predictor, one to four components.

All seventeen difference categories get a five-bit code, or all but two a four-bit one in a complete table:
the encoder stays a few numpy operations, as compression is not the point.
"""

import struct

import numpy as np

CATEGORIES = 17


def encode(samples, *, bits, predictor=1, components=1, tables=1, complete=False):
    """Encode (row, col) samples; with two components the JPEG is half as wide, as DNG writers do.

    With two tables, every odd component is coded with the second one, which counts categories backwards. A
    complete table has a code of ones alone, which ITU T.81 forbids and some writers use.
    """
    rows, cols = samples.shape
    planes = samples.reshape(rows, cols // components, components).astype(np.int64)
    differences = (planes - _predict(planes, bits, predictor)) & 0xFFFF
    differences = np.where(differences > 32768, differences - 65536, differences)
    backwards = np.broadcast_to(np.arange(components) % tables == 1, planes.shape)
    code_bits = np.full(CATEGORIES, 5)
    code_bits[: 15 if complete else 0] = 4
    scan = _scan(differences.ravel(), backwards.ravel(), code_bits)
    return _header(planes.shape, bits, predictor, tables, code_bits) + scan + b"\xff\xd9"


def _predict(planes, bits, predictor):
    left, above, corner = (np.zeros_like(planes) for _ in range(3))
    left[:, 1:] = planes[:, :-1]
    above[1:] = planes[:-1]
    corner[1:, 1:] = planes[:-1, :-1]
    inner = {
        1: left,
        2: above,
        3: corner,
        4: left + above - corner,
        5: left + ((above - corner) >> 1),
        6: above + ((left - corner) >> 1),
        7: (left + above) >> 1,
    }[predictor].copy()
    inner[0] = left[0]
    inner[:, 0] = above[:, 0]
    inner[0, 0] = 1 << (bits - 1)
    return inner


def _header(shape, bits, predictor, tables, code_bits):
    rows, cols, components = shape
    ids = range(1, components + 1)
    sof = struct.pack(">BHHB", bits, rows, cols, components) + b"".join(bytes([i, 0x11, 0]) for i in ids)
    counts = bytes(np.bincount(code_bits, minlength=17)[1:].tolist())
    symbols = bytes(range(CATEGORIES))
    dht = b"".join(bytes([i]) + counts + symbols[:: 1 - 2 * i] for i in range(tables))
    chosen = b"".join(bytes([i, 0x10 * ((i - 1) % tables)]) for i in ids)
    sos = bytes([components]) + chosen + bytes([predictor, 0, 0])
    segments = ((0xC3, sof), (0xC4, dht), (0xDA, sos))
    return b"\xff\xd8" + b"".join(
        struct.pack(">BBH", 0xFF, marker, len(body) + 2) + body for marker, body in segments
    )


def _scan(differences, backwards, code_bits):
    magnitude = np.abs(differences)
    category = np.zeros(differences.shape, np.int64)
    for bit in range(17):
        category[magnitude >= (1 << bit)] = bit + 1
    category = np.minimum(category, 16)
    extra_bits = np.where(category == 16, 0, category)
    extra = np.where(differences < 0, differences - 1, differences) & ((1 << extra_bits) - 1)
    place = np.where(backwards, CATEGORIES - 1 - category, category)
    # the codes of five bits follow the last one of four
    code = np.where(code_bits[place] == 5, place + np.count_nonzero(code_bits == 4), place)
    words = (code << extra_bits) | extra
    lengths = code_bits[place] + extra_bits
    shifts = np.arange(31, -1, -1)
    bits = ((words[:, None] >> shifts) & 1).astype(np.uint8)
    stream = bits[shifts < lengths[:, None]]
    stream = np.concatenate([stream, np.ones(-len(stream) % 8, np.uint8)])
    return np.packbits(stream).tobytes().replace(b"\xff", b"\xff\x00")
