"""Measurements of every kind are recomputed from an export; a changed number, frame or map is found."""

import json
import shutil

import numpy as np
import pytest
import tifffile

from stilb.export import export_measurement, frame_path
from tests.support.certificates import InHouse, complete_version
from tests.support.every_method import make_version
from tests.support.house import KEY, furnished
from tests.support.measuring import field_frame
from tests.verify.changing import nudge
from verify.__main__ import main

GRID = {"corners": [[8, 8], [88, 8], [88, 56], [8, 56]], "rows": 2, "columns": 3}
KINDS = ("luminance", "reflectance", "geometry")


def measure(house, version, *frames, **asked):
    ids = [frame["id"] for frame in frames]
    named = {"frame_ids": ids} if len(ids) > 1 else {"frame_id": ids[0]}
    body = {**named, "calibration_id": version["id"], "products": ["map"], **asked}
    job = house.post("/v1/measurements", body, status=202)
    house.work()
    return house.get(f"/v1/jobs/{job['id']}")["result"]["measurement_id"]


@pytest.fixture(scope="module")
def measured(migrated_sqlite, tmp_path_factory):
    """Exports a measurement with its map, of each method that measures."""
    folder = tmp_path_factory.mktemp("measured")
    with furnished(migrated_sqlite, folder) as house:
        for kind in KINDS:
            version = complete_version(house) if kind == "luminance" else make_version(house, kind)
            asked = {}
            if kind == "luminance":
                asked, frame = {"grid": GRID}, field_frame(house, version["campaign_id"])
            else:
                frame = house.get(f"/v1/campaigns/{version['campaign_id']}/frames")["items"][0]
            export_measurement(InHouse(house), measure(house, version, frame, **asked), folder / kind)
            if kind == "luminance":
                pair = frame, field_frame(house, version["campaign_id"], seed=10)
                export_measurement(
                    InHouse(house), measure(house, version, *pair, **asked), folder / "average"
                )
    return folder


def run(capsys, folder):
    code = main([str(folder / "record.json"), "--data", str(folder)])
    return code, " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize("kind", [*KINDS, "average"])
def test_an_untouched_measurement_agrees(capsys, measured, kind):
    code, said = run(capsys, measured / kind)
    assert "NO" not in said
    assert code == 0
    assert "quantities are the same to the last bit." in said
    assert "map (all) │ 2 │ 2 the same" in said


@pytest.fixture
def luminance(measured, tmp_path):
    return shutil.copytree(measured / "luminance", tmp_path / "luminance")


def test_a_changed_result_is_found(capsys, luminance):
    record = json.loads((luminance / "record.json").read_text())
    nudge(("result", "mean", "value"))(record)
    (luminance / "record.json").write_text(json.dumps(record))
    code, said = run(capsys, luminance)
    assert (code, "result: mean.value" in said) == (1, True)


def test_a_changed_pixel_of_the_map_is_found(capsys, luminance):
    values = tifffile.imread(luminance / "map.tif")
    values[3, 3] *= np.float32(1.001)
    tifffile.imwrite(luminance / "map.tif", values)
    code, said = run(capsys, luminance)
    assert (code, "map: pixels" in said) == (1, True)


def test_a_changed_frame_moves_the_result(capsys, luminance):
    (frame,) = json.loads((luminance / "record.json").read_text())["frames"]
    path = luminance / frame_path(frame | {"frame": frame["filename"]})
    content = bytearray(path.read_bytes())
    for at in range(len(content) // 2 & ~1, (len(content) // 2 & ~1) + 400, 2):
        content[at + 1] ^= 0x04
    path.write_bytes(content)
    code, said = run(capsys, luminance)
    assert code == 1
    assert "frame files: " in said
    assert "result (all)" in said
    assert " different │ NO" in said.split("result (all)")[1]


def test_a_measurement_on_a_server_is_verified_from_there(house, staged, address):
    version = staged(complete_version)
    found = measure(house, version, field_frame(house, version["campaign_id"]))
    assert main([f"{address}/v1/measurements/{found}", "--key", KEY]) == 0
