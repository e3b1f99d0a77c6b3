"""A copy of a DNG with an opcode: LibRaw sees the same numbers, and our reader the opcode."""

import base64
import json
import struct
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import rawpy
import tifffile

from stilb.field.dng import copy_with_opcodes
from stilb.problem import Unclear
from stilb.resources.calibrations import Calibrations
from tests.support.data import data_file
from tests.support.frames import write_frame
from worker.decode import reader

LIST = struct.pack(">5I7d", 1, 3, 0x01030000, 1, 56, 0.3, 0.1, 0, 0, 0, 0.5, 0.5)
GAINS = struct.pack(">5I10I4dIf", 1, 9, 0x01030000, 1, 80, 0, 0, 2, 2, 0, 1, 1, 1, 1, 1, 1, 1, 0, 0, 1, 1.5)
WARP = struct.pack(">5I", 1, 1, 0x01030000, 1, 4) + b"warp"


def read_pixels(path):
    with rawpy.imread(str(path)) as raw:
        return raw.raw_image.copy()


def add(source, target, opcodes, *, stage=3):
    was = reader.read_header(source)
    copy_with_opcodes(source, target, opcodes, stage=stage, size_px=(was.width_px, was.height_px))


@pytest.fixture
def sources(tmp_path):
    # one raw image beside the metadata, and one below a preview
    return [
        write_frame(tmp_path / "main.dng"),
        Path(data_file("dng/canon_14bit_packed_activearea_zero_exif.dng")),
        Path(data_file("dng/blackmagic_bigendian_ljpeg_tiled.dng")),
    ]


def test_the_copy_has_the_opcode_behind_those_it_had_and_the_same_numbers(sources, tmp_path):
    for source in sources:
        before = source.read_bytes()
        target, more = tmp_path / f"copy-{source.name}", tmp_path / f"more-{source.name}"
        add(source, target, WARP)
        add(target, more, LIST)
        assert source.read_bytes() == before
        np.testing.assert_array_equal(read_pixels(more), read_pixels(source))
        was, found = reader.read_header(source), reader.read_header(more)
        assert found.width_px == was.width_px
        names = [(each.stage, each.name) for each in found.opcodes[len(was.opcodes) :]]
        assert names == [(3, "WarpRectilinear"), (3, "FixVignetteRadial")]
        with pytest.raises(Unclear, match="corrects the falloff already"):
            add(more, tmp_path / "twice.dng", GAINS, stage=2)
        with pytest.raises(Unclear, match=f"not for frames of {was.width_px} x {was.height_px} px"):
            copy_with_opcodes(
                source, tmp_path / "twice.dng", LIST, stage=3, size_px=(was.width_px + 1, was.height_px)
            )
        assert not (tmp_path / "twice.dng").exists()
        add(source, target, GAINS, stage=2)
        (added,) = set(reader.read_header(target).opcodes) - set(was.opcodes)
        assert (added.stage, added.name) == (2, "GainMap")


@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize("order", ["<", ">"])
def test_a_raw_image_below_a_preview_is_found(tmp_path, order, count):
    """As DJI and Adobe write it: the entry holds the pointer itself, or leads to several."""
    source, target = tmp_path / "a.dng", tmp_path / "b.dng"
    plane = np.arange(64, dtype=np.uint16).reshape(8, 8)
    version = [(50706, 1, 4, bytes((1, 1, 0, 0)), True)]
    with tifffile.TiffWriter(source, byteorder=order) as file:
        file.write(np.zeros((4, 4, 3), np.uint8), photometric="rgb", subifds=count, extratags=version)
        for each in range(count):
            kind = "minisblack" if each + 1 < count else "cfa"
            file.write(plane, photometric=kind, extratags=[(33421, 3, 2, (2, 2), True)], metadata=None)
    copy_with_opcodes(source, target, LIST, stage=3, size_px=(8, 8))
    with tifffile.TiffFile(target) as file:
        main = file.pages.first
        raw = main.pages[count - 1]
        assert bytes(main.tags[50706].value) == bytes((1, 3, 0, 0))
        assert raw.tags[51022].value == LIST
        np.testing.assert_array_equal(raw.asarray(), plane)
        assert [51022 in each.tags for each in main.pages].count(True) == 1


def test_what_is_no_dng_is_refused_by_name(tmp_path):
    other = tmp_path / "x.dng"
    other.write_bytes(b"II*\0" + b"\xff" * 4)
    for content in (b"II*\0" + b"\xff" * 4, b"\xff\xd8\xff\xe0", b"II*\0\x08\0\0\0\0\0\0\0\0\0"):
        other.write_bytes(content)
        with pytest.raises(Unclear, match=r"x\.dng: "):
            copy_with_opcodes(other, tmp_path / "copy.dng", LIST, stage=3, size_px=(8, 8))
        assert not (tmp_path / "copy.dng").exists()


@pytest.mark.parametrize(
    ("gain_map", "file", "opcodes", "found"),
    [
        (False, "dng.json", LIST, (3, "FixVignetteRadial")),
        (True, "gain-map.json", GAINS, (2, "GainMap")),
    ],
)
def test_the_client_writes_the_opcode_of_the_version(tmp_path, gain_map, file, opcodes, found):
    calls = []
    source, target = write_frame(tmp_path / "a.dng"), tmp_path / "b.dng"
    was = reader.read_header(source)
    answer = {"opcode_list_base64": base64.b64encode(opcodes).decode()}
    answer |= {"width_px": was.width_px, "height_px": was.height_px}

    def send(call):
        calls.append((call.path, call.query))
        return SimpleNamespace(content=json.dumps(answer).encode())

    client = Calibrations.__new__(Calibrations)
    client._transport = SimpleNamespace(send=send)
    assert client.save_corrected("cal_1", source, target, f_number=2.8, gain_map=gain_map) == target
    assert calls == [(f"/v1/calibrations/cal_1/exports/{file}", {"f_number": 2.8})]
    assert [(each.stage, each.name) for each in reader.read_header(target).opcodes] == [found]
