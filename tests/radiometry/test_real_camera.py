"""The series of a real Nikon D70: exponents near the published ones, through the same fit."""

import csv
import math

import numpy as np
import pytest

from radiometry.fitting.curve import fit_curve
from radiometry.fitting.sources import Curve


def read(path):
    with path.open() as lines:
        return [{name: float(value) for name, value in row.items()} for row in csv.DictReader(lines)]


def fit_power(rhs, signal_dn):
    n = len(rhs)
    curve = Curve(
        rhs=np.array(rhs),
        signal_dn=np.array(signal_dn),
        signal_u_dn=0.02 * np.array(signal_dn),
        scenes=("scene",) * n,
        f_numbers=(8.0,) * n,
        times_s=tuple(rhs),
        readings=np.ones(n, np.int64),
        dark_u_dn=1.0,
        dark_dof=math.inf,
        f_number_u_rel=0.0,
        time_u_rel=0.01,
        repeatability_u_rel=0.0,
        lens_shares=np.ones(n),
        lens_u_rel=np.zeros(n),
        dark_lever_s=np.zeros(n),
        lamp_u_rel=np.zeros(n),
        lamp_labels=("",) * n,
        lamp_level_u_rel=np.zeros(n),
        scatter_weights=np.ones(n),
    )
    return fit_curve(curve, model="power")


def usable(rows, channel):
    return [row for row in rows if 150 < row[channel] < 15500]


@pytest.mark.parametrize(("channel", "published"), [("R", 1.01), ("G", 1.00), ("B", 1.02)])
def test_time_is_linear(real_data, channel, published):
    rows = [
        r
        for r in usable(read(real_data / "nikon-d70" / "exposure_series.csv"), channel)
        if r["f_number"] == 11
    ]
    fit = fit_power([r["exposure_s"] for r in rows], [r[channel] for r in rows])
    assert fit.parameters[1] == pytest.approx(published, abs=0.03)


@pytest.mark.parametrize("channel", ["R", "Gr", "Gb", "B"])
def test_iso_is_linear(real_data, channel):
    rows = usable(read(real_data / "nikon-d70" / "iso_series_t1_250_f2.8.csv"), channel)
    fit = fit_power([r["iso"] for r in rows], [r[channel] for r in rows])
    assert 0.98 - 0.02 < fit.parameters[1] < 1.04 + 0.02


@pytest.mark.parametrize(("channel", "published"), [("R", 2.02), ("G", 2.04), ("B", 2.10)])
def test_aperture_is_nearly_quadratic(real_data, channel, published):
    rows = usable(read(real_data / "nikon-d70" / "aperture_series_t1_250.csv"), channel)
    fit = fit_power([1 / r["f_number"] ** 2 for r in rows], [r[channel] for r in rows])
    assert 2 * fit.parameters[1] == pytest.approx(published, abs=0.06)
