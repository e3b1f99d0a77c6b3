"""Certificates of every method are recomputed from an export; a changed panel, frame or number is found."""

import json
import os
import platform
import shutil
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest

from radiometry import methods
from stilb.export import export_measurement
from tests.support.campaigns import calibrate
from tests.support.certificates import METER, InHouse, complete_version, export_version
from tests.support.every_method import make_version, reflectance_campaign, register_panel
from tests.support.house import furnished
from tests.support.measuring import measure
from tests.verify.changing import change, nudge, run

MEASUREMENT = "measurement"
OTHERS = [spec.name for spec in methods.METHODS if spec.name != "luminance"]
UNCERTIFIED = {
    "a meter without a certificate": lambda house: complete_version(
        house, meter={name: value for name, value in METER.items() if name != "certificate"}
    ),
    "a panel without uncertainties": lambda house: calibrate(
        house, reflectance_campaign(house), panel_id=register_panel(house, serial="P-19", u=None)["id"]
    ),
}
CASES = [*OTHERS, *UNCERTIFIED]


@pytest.fixture(scope="module")
def exports(migrated_sqlite, tmp_path_factory):
    """Exports each method's version when a test first asks for it."""
    folder = tmp_path_factory.mktemp("every")
    made = {}
    with furnished(migrated_sqlite, folder) as house:

        def bring(method):
            if method not in made:
                version = UNCERTIFIED[method](house) if method in UNCERTIFIED else make_version(house, method)
                made[method] = export_version(house, version, folder / method)
                if method == "reflectance":
                    frame = house.get(f"/v1/campaigns/{version['campaign_id']}/frames")["items"][0]
                    made[MEASUREMENT] = folder / MEASUREMENT
                    export_measurement(
                        InHouse(house), measure(house, frame, version)["id"], made[MEASUREMENT]
                    )
            return made[method]

        yield bring


@pytest.mark.parametrize("method", CASES)
def test_an_untouched_export_agrees(capsys, exports, method):
    code, said = run(capsys, exports(method))
    assert "NO" not in said
    assert code == 0
    assert "quantities are the same to the last bit." in said
    certificate = json.loads((exports(method) / "certificate.json").read_text())
    first = certificate["coefficients"][0]
    assert f"│ {first['value']!r} │ {first['value']!r} │ yes" in said
    assert (exports(method) / "panels.json").exists() == (certificate["method"] == "reflectance")


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


VERIFY_ALL = """
import sys
from contextlib import nullcontext
from pathlib import Path

from verify import __main__ as verify

codes = []
with verify.DecoderPool() as pool:
    verify.DecoderPool = lambda: nullcontext(pool)
    for folder in map(Path, sys.argv[1:]):
        (stated,) = (path for name in ("certificate", "record") if (path := folder / f"{name}.json").exists())
        codes.append(verify.main([str(stated), "--data", str(folder)]))
print(codes)
"""


@pytest.mark.skipif(platform.machine() != "x86_64", reason="the names of kernels are of this processor")
def test_installed_with_another_kernel_and_numpy_it_agrees_to_rounding(
    installed, exports, exported_once, another_numpy, tmp_path
):
    """One process with other linear algebra recomputes all certificates, and finds a changed one."""
    changed = shutil.copytree(exported_once, tmp_path / "changed")
    change(changed / "certificate.json", nudge(("result", "iso_fits", 0, "coefficient", "luminance_k")))
    same = [exported_once, *map(exports, [*CASES, MEASUREMENT])]
    command = [installed / "bin" / "stilb-verify", changed / "certificate.json", "--data", changed]
    found = subprocess.run(command, check=False, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert (found.returncode, found.stderr) == (1, "")
    assert "iso_fits[0].coefficient.luminance_k" in found.stdout
    done = subprocess.run(
        [installed / "bin" / "python", "-c", VERIFY_ALL, *map(str, [*same, changed])],
        check=True,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        env=os.environ
        | {"OPENBLAS_CORETYPE": "Nehalem", "COLUMNS": "250"}
        | ({"PYTHONPATH": f"{another_numpy}:{os.environ.get('PYTHONPATH', '')}"} if another_numpy else {}),
    )
    assert done.stdout.splitlines()[-1] == str([0] * len(same) + [1])
    assert "are the same to rounding" in done.stdout
    if another_numpy is None:
        pytest.skip("another kernel agrees; no other release of numpy could be fetched")
    (installed,) = another_numpy.glob("numpy-*.dist-info")
    version = installed.stem.removeprefix("numpy-")
    assert version != metadata.version("numpy")
    assert done.stdout.count(f"Recomputed with numpy {version} and") == len(same) + 1


@pytest.fixture
def reflectance(exports, tmp_path):
    return shutil.copytree(exports("reflectance"), tmp_path / "export")


def test_a_changed_panel_is_found_and_moves_k(capsys, reflectance):
    def edit(panels):
        panels[0]["bands"][0]["reflectance"] *= 1.01

    change(reflectance / "panels.json", edit)
    code, said = run(capsys, reflectance)
    assert code == 1
    assert "panels: [0].bands[0].reflectance │ 0.18 │ 0.1818" in said
    k = said.split("Reflectance K, green │")[1].split("u(Reflectance K")[0]
    assert "NO" in k
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


def test_a_target_or_a_part_of_a_region_that_was_changed_is_found(capsys, exports, tmp_path):
    folder = shutil.copytree(exports("geometry"), tmp_path / "geometry")

    def enlarge(certificate):
        certificate["target"]["square_size_mm"] *= 2

    change(folder / "certificate.json", enlarge)
    code, said = run(capsys, folder)
    assert code == 1
    assert "software: extractor" in said
    folder = shutil.copytree(exports("sharpness"), tmp_path / "sharpness")

    def move(regions):
        regions[0]["parts"][0]["points"][0][0] += 1.0

    change(folder / "roi.json", move)
    code, said = run(capsys, folder)
    assert code == 1
    assert "regions: SHA-256 of its corners" in said
