"""What the simulation knows of a capture, the worker reads from the files that are written of it."""

import re
from dataclasses import replace
from datetime import datetime, timedelta, timezone

import numpy as np
import pytest

from simulation.camera import change
from simulation.multispectral_files import name_file, write_sequoia
from simulation.sequoia import SEQUOIA, capture
from tests.support import reader

SURFACE = {"green": 0.18, "red": 0.1, "red_edge": 0.3, "nir": 0.5}
CAMERA = change(SEQUOIA, height_px=72, width_px=101)


@pytest.fixture(scope="module")
def shots():
    taken_at = datetime(2018, 4, 13, 10, 5, 6, tzinfo=timezone(timedelta(hours=2)))
    random = np.random.default_rng(4)
    indices = (0, 1, 1, 2, 3)
    return capture(
        CAMERA, random, reflectance=SURFACE, gain_indices=indices, exposure_time_s=1 / 350, taken_at=taken_at
    )


def read_header(path):
    """Without the rows that are best read at once: they tell of the file, not of the capture."""
    return replace(reader.read_header(path), band_rows=1, first_band_rows=1)


@pytest.mark.parametrize("band", SURFACE)
def test_the_file_is_the_simulated_capture(shots, band, tmp_path):
    path = tmp_path / "band.tif"
    write_sequoia(path, shots[band])
    assert read_header(path) == shots[band].header
    found = reader.read_window(path, 0, 0, 72, 101)
    np.testing.assert_array_equal(found.samples_dn, shots[band].frame.samples_dn)
    assert found.black_level_dn == shots[band].frame.black_level_dn


def test_what_is_absent_stays_absent(shots, tmp_path):
    shot = shots["red"]
    band = replace(
        shot.header.multispectral,
        counts=None,
        sunshine_missing="the file has no IrradianceList: no sunshine sensor was connected",
        vignetting_polynomial=None,
        problem="VignettingPolynomial2DName is missing",
        sunshine_serial=None,
        geometry=None,
    )
    shot = replace(shot, header=replace(shot.header, multispectral=band, latitude_deg=-3.5))
    path = tmp_path / "band.tif"
    write_sequoia(path, shot)
    assert read_header(path) == shot.header


def test_files_are_named_as_the_camera_names_them(shots):
    names = [name_file(3, shot.header) for shot in shots.values()]
    assert names[0] == "IMG_180413_100506_0003_GRE.TIF"
    assert all(re.fullmatch(r"IMG_180413_100506_0003_(GRE|RED|REG|NIR)[.]TIF", name) for name in names)
