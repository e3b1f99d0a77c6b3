"""Measurements of every kind are recomputed from an export; a changed number, frame or map is found."""

import json
import shutil

import numpy as np
import pytest
import tifffile

from stilb.export import frame_path
from tests.support.house import KEY
from tests.support.measuring import field_frame
from tests.verify.changing import change, nudge, require_the_same, run
from verify.__main__ import main

GRID = {"corners": [[8, 8], [88, 8], [88, 56], [8, 56]], "rows": 2, "columns": 3}


@pytest.fixture(scope="module")
def fields(exports):
    campaign_id = exports.version("luminance")["campaign_id"]
    return [field_frame(exports.house, campaign_id, seed=seed) for seed in (9, 10)]


@pytest.fixture
def measured(exports, fields):
    """Exports a measurement with its map, of each method that measures and of the average of two frames."""

    def bring(kind):
        if kind in {"luminance", "average"}:
            frames = fields if kind == "average" else fields[:1]
            return exports.of_measurement(kind, "luminance", frames, grid=GRID)
        campaign_id = exports.version(kind)["campaign_id"]
        frames = exports.house.get(f"/v1/campaigns/{campaign_id}/frames")["items"][:1]
        return exports.of_measurement(kind, kind, frames)

    return bring


@pytest.mark.parametrize("kind", ["luminance", "reflectance", "geometry", "average"])
def test_an_untouched_measurement_agrees(capsys, measured, kind):
    said = require_the_same(capsys, measured(kind), "record.json")
    assert "map (all) │ 2 │ 2 the same" in said


@pytest.fixture
def luminance(measured, tmp_path):
    return shutil.copytree(measured("luminance"), tmp_path / "luminance")


def test_a_changed_result_or_pixel_of_the_map_is_found(capsys, luminance):
    change(luminance / "record.json", nudge(("result", "mean", "value")))
    values = tifffile.imread(luminance / "map.tif")
    values[3, 3] *= np.float32(1.001)
    tifffile.imwrite(luminance / "map.tif", values)
    code, said = run(capsys, luminance, "record.json")
    assert (code, "result: mean.value" in said, "map: pixels" in said) == (1, True, True)


def test_a_changed_frame_moves_the_result(capsys, luminance):
    (frame,) = json.loads((luminance / "record.json").read_text())["frames"]
    path = luminance / frame_path(frame | {"frame": frame["filename"]})
    content = bytearray(path.read_bytes())
    for at in range(len(content) // 2 & ~1, (len(content) // 2 & ~1) + 400, 2):
        content[at + 1] ^= 0x04
    path.write_bytes(content)
    code, said = run(capsys, luminance, "record.json")
    assert (code, "frame files: " in said) == (1, True)
    assert "result (all)" in said
    assert " different │ NO" in said.split("result (all)")[1]


def test_a_measurement_on_a_server_is_verified_from_there(measured, address):
    record = json.loads((measured("luminance") / "record.json").read_text())
    assert main([f"{address}/v1/measurements/{record['id']}", "--key", KEY]) == 0
