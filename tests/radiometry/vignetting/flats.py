"""Simulated flats, as rows of a campaign; and blocks of light without noise."""

from dataclasses import replace

import numpy as np

from radiometry.fitting.evidence import Region
from radiometry.frame.exposure import Exposure
from radiometry.frame.roi import Polygon
from radiometry.vignetting import fit as vignetting
from radiometry.vignetting.blocks import Grid, Radial, Site, extract_features
from radiometry.vignetting.falloff import Blocks
from radiometry.vignetting.results import Coefficient
from simulation.camera import change, take
from simulation.targets import FAST_LENS, Surface, plan_dark, plan_flat

SMALL = change(FAST_LENS, height_px=192, width_px=288, centre_px=(88.0, 155.0))
NONE = vignetting.Params()
WHOLE = Site(row0=0, col0=0, step=1)


def whole(height_px, width_px):
    corners = [(0, 0), (width_px, 0), (width_px, height_px), (0, height_px)]
    return Region(name="", polygon=Polygon.from_points(corners))


def row(shot, *, regions=None, name=None, **changes):
    regions = regions or [whole(shot.frame.height_px, shot.frame.width_px)]
    extracted = extract_features(shot.frame, regions, header=shot.header)
    fields = {
        "frame": name or shot.name,
        "role": shot.role,
        "scene": None,
        "header": shot.header,
        "exposure": shot.exposure,
        "statistics": extracted.statistics,
        "features": extracted.features,
    }
    return vignetting.FrameRow(**(fields | changes))


def flat(lens, seed, f_number=1.4, *, name="flat", target=None, **changes):
    shot = plan_flat(lens, f_number=f_number, name=name, surface=target)
    return row(take(lens, shot, np.random.default_rng(seed)), **changes)


def surface(share=0.7, **changes):
    return Surface(share=share, **changes)


def dark(lens, seed, *, name="dark", time_s=0.01, iso=100.0):
    shot = take(lens, plan_dark(name=name, iso=iso), np.random.default_rng(seed))
    return row(shot, exposure=Exposure(exposure_time_s=time_s, f_number=8.0, iso=iso))


def state_black(row, black_level_dn):
    channels = tuple(replace(each, black_level_dn=black_level_dn) for each in row.features.channels)
    return replace(row, features=replace(row.features, channels=channels))


def flags_of(raised):
    return {each.flag for each in raised}


def exact_blocks(grid, k, centre_px, *, gradient=(0.0, 0.0), error=1e-3, site=WHOLE):
    rows, cols = grid.axes(site)
    radial = Radial(
        rows, cols, centre_row_px=centre_px[0], centre_col_px=centre_px[1], radius_px=grid.half_diagonal_px
    )
    a = (rows.means - grid.middle_px[0]) / grid.half_diagonal_px
    b = (cols.means - grid.middle_px[1]) / grid.half_diagonal_px
    light = 1.0 + np.tensordot(np.array(k), radial.means, 1)
    light = light * (1.0 + gradient[0] * a[:, None] + gradient[1] * b[None, :])
    return Blocks(grid=grid, rows=rows, cols=cols, light=light, standard_error=np.full(light.shape, error))


def coefficient(**changes):
    """V = 1 - 0.4 r^2 + 0.1 r^4 about row 100, column 200 of a frame of 300 x 400: R = 250 px."""
    fields = {
        "f_number": 2.0,
        "channel": "G1",
        "height_px": 300,
        "width_px": 400,
        "radius_px": 250.0,
        "centre_row_px": 100.0,
        "centre_col_px": 200.0,
        "k1": -0.4,
        "k2": 0.1,
        "k3": 0.0,
        "covariance": tuple(tuple(1e-4 if i == j else 0.0 for j in range(5)) for i in range(5)),
        "model_u_rel": 0.0,
        "corner_falloff": 0.3,
        "corner_falloff_standard_uncertainty": 0.01,
    }
    return Coefficient(**(fields | changes))


def grid_of(height_px, width_px):
    return Grid.over(height_px, width_px)
