"""Certificates of every method are recomputed from an export; a changed panel, frame or number is found."""

import json
import os
import platform
import shutil
import subprocess
import sys
from dataclasses import replace
from importlib import metadata
from pathlib import Path

import pytest

from radiometry import methods
from store.fits import make_version, read_params, write_version
from store.queries.evidence import gather
from store.tables import Calibration, Campaign
from tests.support.campaigns import calibrate
from tests.support.certificates import METER, WORK, certificate_of, complete_version, export_version
from tests.support.every_method import register_panel
from tests.support.frames import forget_time
from tests.verify.changing import change, nudge, require_the_same, run


@pytest.mark.parametrize("method", [spec.name for spec in methods.METHODS])
def test_an_untouched_export_agrees(capsys, exports, method):
    said = require_the_same(capsys, exports.of(method))
    certificate = json.loads((exports.of(method) / "certificate.json").read_text())
    first = certificate["coefficients"][0]
    assert f"│ {first['value']!r} │ {first['value']!r} │ yes" in said
    assert (exports.of(method) / "panels.json").exists() == (method == "reflectance")


def test_a_panel_without_uncertainties_agrees(capsys, exports, tmp_path):
    panel = register_panel(exports.house, serial="P-19", u=None)
    campaign = {"id": exports.version("reflectance")["campaign_id"]}
    version = calibrate(exports.house, campaign, panel_id=panel["id"])
    require_the_same(capsys, export_version(exports.house, version, tmp_path / "export"))


def test_a_meter_without_a_certificate_and_clocks_in_a_stated_zone_agree(
    exports, monkeypatch, tmp_path, capsys
):
    """20:00 in Berlin is 18:00 in UTC; without a zone, 15:00 would be taken for the time of the frames."""
    house, write = exports.house, exports.house.frame_bytes
    monkeypatch.setattr(house, "frame_bytes", lambda **of: forget_time(write(**of), zone_only=True))
    meter = {name: value for name, value in METER.items() if name != "certificate"} | {"serial": "bare"}
    work = WORK | {"time_zone": "Europe/Berlin"}
    version = complete_version(house, meter=meter, work=work, taken_at="2026-05-01T15:00:00Z")
    certificate = certificate_of(house, version)
    assert "certificate" not in certificate["meters"][0]
    far = next(each for each in certificate["flags"] if each["flag"] == "reading_far_from_frames")
    assert far["detail"] == "A reading was taken 3.0 h from the nearest frame."
    assert {each["clock_offset"] for each in certificate["frames"]} == {"+02:00"}
    require_the_same(capsys, export_version(house, version, tmp_path / "export"))


def test_another_kernel_makes_no_other_version(exports):
    """Results that differ by the rounding of another processor are of the same version."""
    version = exports.version("luminance")
    with exports.house.database.writing("test") as session:
        row = session.get_one(Campaign, version["campaign_id"])
        made = session.get_one(Calibration, version["id"])
        params, evidence = read_params(row, made.parameters), gather(session, row)
        fitted = methods.get_method("luminance").fit(evidence.frames, evidence.readings, params)
        iso, *others = fitted.iso_fits
        k = replace(iso.coefficient, luminance_k=iso.coefficient.luminance_k * (1 + 1e-15))
        rounded = replace(fitted, iso_fits=(replace(iso, coefficient=k), *others))
        new = make_version(session, row, evidence, params, rounded, by="another worker")
        found = write_version(session, new)
        assert (found.id, found.result == made.result) == (version["id"], True)


@pytest.fixture(scope="module")
def another_numpy(tmp_path_factory):
    """The release of numpy before this one, in a folder; None where no package can be fetched."""
    folder = tmp_path_factory.mktemp("numpy")
    uv = Path(sys.executable).with_name("uv")
    needed = next(each for each in metadata.requires("scipy") or [] if each.startswith("numpy"))
    older = f"numpy<{'.'.join(metadata.version('numpy').split('.')[:2])}"
    install = [uv, "pip", "install", "-q", "--no-deps", "--only-binary", ":all:", "--target", folder]
    for more in (["--offline"], []):
        command = [*install, "--python", sys.executable, *more, older, needed]
        if subprocess.run(command, check=False, capture_output=True).returncode == 0:
            return folder
    return None


# the command, for one export after the other
EVERY = """
import sys
from verify.__main__ import main
sys.exit(any([main([f"{each}/certificate.json", "--data", each]) for each in sys.argv[1:]]))
"""


@pytest.mark.skipif(platform.machine() != "x86_64", reason="the names of kernels are of this processor")
def test_installed_with_another_kernel_and_numpy_it_agrees_to_rounding(
    installed, exports, exported, another_numpy, tmp_path
):
    """The installed command with other linear algebra recomputes each method, and finds a changed number."""
    change(exported / "certificate.json", nudge(("result", "iso_fits", 0, "coefficient", "luminance_k")))
    other = {"OPENBLAS_CORETYPE": "Nehalem", "COLUMNS": "250"}
    if another_numpy:
        other["PYTHONPATH"] = f"{another_numpy}:{os.environ.get('PYTHONPATH', '')}"
    same = [installed / "bin" / "python", "-c", EVERY, *(exports.of(spec.name) for spec in methods.METHODS)]
    moved = [installed / "bin" / "stilb-verify", exported / "certificate.json", "--data", exported]
    said = []
    for command, code in ((same, 0), (moved, 1)):
        done = subprocess.run(
            command,
            check=False,
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=600,
            env=os.environ | other,
        )
        assert (done.returncode, done.stderr) == (code, "")
        said.append(done.stdout)
    assert "are the same to rounding" in said[0]
    assert "iso_fits[0].coefficient.luminance_k" in said[1]
    if another_numpy is None:
        pytest.skip("another kernel agrees; no other release of numpy could be fetched")
    (found,) = another_numpy.glob("numpy-*.dist-info")
    version = found.stem.removeprefix("numpy-")
    assert version != metadata.version("numpy")
    told = [each.count(f"Recomputed with numpy {version} and") for each in said]
    assert told == [len(methods.METHODS), 1]


@pytest.fixture
def reflectance(exports, tmp_path):
    return shutil.copytree(exports.of("reflectance"), tmp_path / "export")


def test_a_changed_panel_is_found_and_moves_k(capsys, reflectance):
    change(reflectance / "panels.json", nudge((0, "bands", 0, "reflectance"), by=0.01))
    code, said = run(capsys, reflectance)
    assert code == 1
    assert "panels: [0].bands[0].reflectance │ 0.18 │ 0.1818" in said
    assert "NO" in said.split("Reflectance K, green │")[1].split("u(Reflectance K")[0]
    assert "content hash: content SHA-256" in said


PLACES = {
    ("coefficients", 1, "expanded_uncertainty"): "coefficients[1].expanded_uncertainty",
    ("result", "band_fits", 0, "coefficient", "knots", 0, "reflectance_k"): (
        "band_fits[0].coefficient.knots[0].reflectance_k"
    ),
    ("panels", 0, "bands", 0, "standard_uncertainty"): "panels: [0].bands[0].standard_uncertainty",
}


def test_each_changed_number_in_the_certificate_is_found(capsys, reflectance):
    """By a millionth, and although the data's own copy was changed along with it."""
    for place in PLACES:
        change(reflectance / "certificate.json", nudge(place))
    code, said = run(capsys, reflectance)
    assert (code, "3 of" in said) == (1, True)
    assert [named for named in PLACES.values() if f"{named} │" not in said] == []


@pytest.mark.parametrize(
    ("method", "name", "place", "told"),
    [
        ("geometry", "certificate.json", ("target", "square_size_mm"), "software: extractor"),
        ("sharpness", "roi.json", (0, "parts", 0, "points", 0, 0), "regions: SHA-256 of its corners"),
        ("luminance", "roi.json", (0, "points", 0, 0), "regions: SHA-256 of its corners"),
    ],
)
def test_a_target_or_a_part_of_a_region_that_was_changed_is_found(
    capsys, exports, tmp_path, method, name, place, told
):
    folder = shutil.copytree(exports.of(method), tmp_path / "export")

    def move(content):
        *path, last = place
        for each in path:
            content = content[each]
        content[last] += 1.0

    change(folder / name, move)
    code, said = run(capsys, folder)
    assert (code, told in said) == (1, True)
