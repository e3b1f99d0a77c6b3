"""The list of methods forwards, and nothing else."""

import numpy as np

from radiometry import methods
from radiometry.frame import Frame
from radiometry.methods import luminance
from radiometry.roi import Polygon
from tests.radiometry.evidence import taken


def test_every_method_has_a_schema_version():
    assert methods.METHODS == ("luminance",)
    assert all(methods.schema_version(method) >= 1 for method in methods.METHODS)


def test_luminance_is_forwarded(drawn):
    params = luminance.Params()
    assert methods.missing("luminance", (), (), params) == luminance.missing((), (), params)
    assert methods.plan("luminance", drawn.rows, drawn.readings, params) == luminance.plan(
        drawn.rows, drawn.readings, params
    )
    frames = [taken(row) for row in drawn.rows]
    assert methods.judge("luminance", frames, drawn.rows, drawn.readings, params) == luminance.judge(
        frames, drawn.rows, drawn.readings, params
    )
    fit = methods.fit("luminance", drawn.rows, drawn.readings, params)
    assert fit == luminance.fit(drawn.rows, drawn.readings, params)
    row = drawn.rows[0]
    coefficients = [iso_fit.coefficient for iso_fit in fit.iso_fits]
    assert methods.apply(
        "luminance", row.statistics, exposure=row.exposure, coefficients=coefficients
    ) == luminance.apply(row.statistics, exposure=row.exposure, coefficients=coefficients)


def test_extraction_is_forwarded():
    frame = Frame(
        samples_dn=np.arange(16, dtype=np.uint16).reshape(4, 4),
        row0=0,
        col0=0,
        height_px=4,
        width_px=4,
        cfa="RGGB",
        black_level_dn=(0.0,),
        white_level_dn=(4095.0,),
    )
    polygon = Polygon.from_points([(0, 0), (4, 0), (4, 4), (0, 4)])
    assert methods.extract("luminance", frame, polygon) == luminance.extract(frame, polygon)
