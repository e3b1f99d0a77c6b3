"""The parent believes no length, shape or number of its child without checking it."""

import json
import os
import struct
import time
from dataclasses import asdict

import numpy as np
import pytest

from tests.support import reader
from tests.worker.decode.dng_variants import Variant, make_dng, make_samples
from worker.decode import answers, messages
from worker.decode.messages import BrokenMessageError


@pytest.fixture
def header(save):
    return asdict(reader.read_header(save(make_dng(make_samples(32, 48, 16), Variant()))))


@pytest.fixture
def pipe():
    ends = os.pipe()
    yield ends
    for end in ends:
        os.close(end)


def test_header_survives_the_way(header):
    told = json.loads(json.dumps(header))
    assert asdict(answers.check_header({"header": told})) == header


@pytest.mark.parametrize(
    "change",
    [
        {"cfa": "XTRANS"},
        {"width_px": 1 << 40},
        {"height_px": -1},
        {"width_px": "many"},
        {"black_level_dn": [1.0]},
        {"white_level_dn": []},
        {"make": "x" * 300},
        {"model": "a\0b"},
        {"opcodes": [{"stage": 1}]},
        {"latitude_deg": 90.5},
        {"longitude_deg": -180.5},
        {"band_rows": 0},
        {"first_band_rows": 3},
        {"multispectral": {"system": "sequoia", "band": "x" * 300, "band_name": "NIR"}},
        {"multispectral": {"system": "sequoia", "band": "nir", "band_name": "a\0b"}},
        {"multispectral": {"system": "other", "band": "nir", "band_name": "NIR"}},
    ],
)
def test_header_that_cannot_be(change, header):
    with pytest.raises(BrokenMessageError):
        answers.check_header({"header": {**header, **change}})


FRAME = {"row0": 2, "col0": 4, "height_px": 32, "width_px": 48, "cfa": "RGGB"}
FRAME |= {"black_level_dn": [1.0, 2, 3, 4], "white_level_dn": [9.0] * 4}


def test_frame_of_the_window_asked_for():
    body = bytearray(np.arange(6, dtype=np.uint16).tobytes())
    frame = answers.check_frame({"frame": FRAME}, body, (2, 4, 2, 3))
    assert frame.samples_dn.tolist() == [[0, 1, 2], [3, 4, 5]]
    assert frame.black_level_dn == (1, 2, 3, 4)


@pytest.mark.parametrize(
    ("change", "size"),
    [
        ({}, 11),
        ({}, 14),
        ({"row0": 3}, 12),
        ({"cfa": "rgb"}, 12),
        ({"height_px": 0}, 12),
        ({"black_level_dn": [1.0] * 3}, 12),
        ({"white_level_dn": [None] * 4}, 12),
    ],
)
def test_frame_of_another_shape(change, size):
    with pytest.raises(BrokenMessageError):
        answers.check_frame({"frame": {**FRAME, **change}}, bytearray(size), (2, 4, 2, 3))


@pytest.mark.parametrize("code", ["", "no_such_code", None, 7])
def test_refusal_with_an_unknown_code(code):
    with pytest.raises(BrokenMessageError):
        answers.check_refusal({"refused": {"code": code, "message": "so"}})


@pytest.mark.parametrize(
    "sent",
    [
        struct.pack(">II", 1 << 31, 0),
        struct.pack(">II", 2, 100) + b"{}",
        struct.pack(">II", 2, 0) + b"[]",
        struct.pack(">II", 3, 0) + b"{{{",
        struct.pack(">II", 9, 0) + b'{"a":NaN}',
        struct.pack(">II", 11, 0) + b'{"a":1e999}',
    ],
)
def test_message_that_breaks_the_protocol(sent, pipe):
    os.write(pipe[1], sent)
    with pytest.raises(BrokenMessageError):
        messages.receive(pipe[0], max_body_bytes=10)


def test_message_that_never_comes(pipe):
    os.write(pipe[1], b"\0\0")
    with pytest.raises(TimeoutError):
        messages.receive(pipe[0], deadline=time.monotonic() + 0.05)


def test_message_and_body_survive_the_way(pipe):
    body = np.arange(5, dtype=np.uint16)
    messages.send(pipe[1], {"hello": 1.5}, body.data)
    message, received = messages.receive(pipe[0], max_body_bytes=10)
    assert message == {"hello": 1.5}
    assert bytes(received) == body.tobytes()
