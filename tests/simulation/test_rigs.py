"""Rigs of MicaSense and DJI: what the simulation knows of a capture, the reader gets and K agrees with."""

from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from radiometry.frame.roi import Polygon
from radiometry.reflectance import method as reflectance
from simulation.camera import change
from simulation.multispectral_files import write_rig
from simulation.rigs import RIGS, capture
from tests.radiometry.reflectance import captures
from tests.support import reader

CORNER = Polygon.from_points([(4, 4), (44, 4), (44, 30), (4, 30)])


@pytest.fixture(scope="module", params=RIGS)
def rig(request):
    return change(RIGS[request.param], height_px=72, width_px=100)


@pytest.fixture
def shots(rig):
    return capture(rig, np.random.default_rng(4), reflectance=dict.fromkeys(rig.bands, 0.4), light=0.9)


def test_the_files_are_read_back_whole(shots, tmp_path):
    for band, shot in shots.items():
        path = Path(tmp_path, f"{band}.tif")
        write_rig(path, shot)
        found = replace(
            reader.read_header(path), band_rows=1, first_band_rows=1, attitude=(), exposure_time_s=None
        )
        told = replace(shot.header, exposure_time_s=None)
        assert _round(asdict(found)) == _round(asdict(told))
        samples = reader.read_window(path, 0, 0, 72, 100).samples_dn
        np.testing.assert_array_equal(samples, shot.frame.samples_dn)


def _round(value):
    """Radians, micrometres and microwatts cost the last digits."""
    if isinstance(value, dict):
        return {name: _round(each) for name, each in value.items()}
    if isinstance(value, tuple):
        return tuple(map(_round, value))
    return float(f"{value:.12g}") if isinstance(value, float) else value


def test_k_is_the_true_one_even_in_the_darkest_corner(rig, shots):
    rows = [captures.row(band, shot, polygon=CORNER) for band, shot in shots.items()]
    readings = [
        reflectance.Reading(panel="P", band=band, reflectance=0.4, standard_uncertainty=0.002)
        for band in shots
    ]
    for each in reflectance.fit(rows, readings, reflectance.Params()).band_fits:
        # the light sensor's noise of 0.3 %, which one reading does not show, and that of the pixels
        assert each.coefficient.reflectance_k == pytest.approx(
            rig.bands[each.coefficient.band].reflectance_k, rel=0.015
        )
