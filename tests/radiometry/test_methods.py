"""The specifications of the methods, and what luminance makes of frames and fits."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest

from radiometry import methods
from radiometry.fitting.evidence import Extracted, FrameEvidence, Region
from radiometry.frame import Opcode
from radiometry.frame.roi import Polygon
from radiometry.luminance import method as luminance
from tests.radiometry.frame.test_acceptance import HEADER
from tests.radiometry.frames import frame_of

POLYGON = Polygon.from_points([(0, 0), (4, 0), (4, 4), (0, 4)])


@pytest.mark.parametrize("spec", methods.METHODS, ids=lambda spec: spec.name)
def test_a_specification_is_complete(spec):
    assert spec.schema_version >= 1
    assert spec.label
    assert spec.description.endswith(".")
    assert spec.roles
    assert spec.params() == spec.params(exclude=())
    stated = {each.field for each in spec.parameters}
    assert stated == {field.name for field in fields(spec.params)} - {"exclude"}
    assert len({each.name for each in spec.parameters}) == len(spec.parameters)
    for each in spec.parameters:
        assert each.label
        assert each.description.endswith((".", "%."))
        assert each.default is not None or (each.default_text and (each.members or each.example is not None))
        assert not each.choices or each.default in {None, *(choice.value for choice in each.choices)}
    assert len({each.name for each in spec.coefficients}) == len(spec.coefficients)
    assert isinstance(spec.find_gaps((), (), spec.params()), tuple)


def list_wrong(parameter):
    """What lies outside of the stated range, and what is no number."""
    if parameter.choices:
        yield "no such choice"
    elif parameter.kind in {"number", "integer"}:
        yield from (math.nan, math.inf)
        if parameter.minimum is not None:
            yield parameter.minimum - (not parameter.above_minimum)
        if parameter.maximum is not None:
            yield parameter.maximum + (not parameter.below_maximum)
    elif parameter.kind == "interval":
        yield (parameter.maximum, parameter.minimum)


@pytest.mark.parametrize("spec", methods.METHODS, ids=lambda spec: spec.name)
def test_no_parameter_takes_what_lies_outside_its_range(spec):
    wrong = [(each.field, value) for each in spec.parameters for value in list_wrong(each)]
    assert wrong
    for field, value in wrong:
        with pytest.raises(ValueError, match=f"{field} must (be|lie|hold)"):
            spec.params(**{field: value})


def test_extraction_is_forwarded():
    frame = frame_of(np.arange(16).reshape(4, 4), black=0.0)
    extracted = methods.get_method("luminance").extract(
        frame, [Region(name="", polygon=POLYGON)], header=HEADER, exposure=None
    )
    assert extracted == Extracted(statistics=luminance.extract(frame, POLYGON), features=None)


def test_a_row_of_luminance_names_its_gain_maps_alone(drawn):
    row = drawn.rows[0]
    opcodes = (
        Opcode(stage=2, name="GainMap", sha256="a" * 64),
        Opcode(stage=3, name="WarpRectilinear", sha256="b" * 64),
    )
    evidence = FrameEvidence(
        frame=row.frame,
        role=row.role,
        scene=row.scene,
        header=replace(HEADER, rendered=True, opcodes=opcodes),
        exposure=row.exposure,
        statistics=row.statistics,
        features=None,
        has_region=False,
    )
    made = methods.get_method("luminance").make_row(evidence)
    assert made == replace(row, rendered=True, gain_maps=("a" * 64,), has_region=False)


def test_the_figures_of_luminance_are_k_and_dark_by_rising_iso(drawn):
    fit = luminance.fit(drawn.rows, drawn.readings, luminance.Params())
    figures = luminance.list_coefficients(fit)
    count = len(fit.iso_fits)
    apertures = [(f.coefficient.iso, a.f_number) for f in fit.iso_fits for a in f.coefficient.apertures]
    assert [(f.name, f.iso, f.f_number) for f in figures] == [
        *(("luminance_k", f.coefficient.iso, None) for f in fit.iso_fits),
        *(("luminance_k", *at) for at in apertures),
        *(("dark_signal_dn", f.coefficient.iso, None) for f in fit.iso_fits),
    ]
    coefficient = min((each.coefficient for each in fit.iso_fits), key=lambda each: each.iso)
    assert (figures[0].value, figures[0].standard_uncertainty, figures[0].iso) == (
        coefficient.luminance_k,
        coefficient.luminance_k_standard_uncertainty,
        coefficient.iso,
    )
    assert figures[-count].value == coefficient.dark_signal_dn
    raised = {flag.flag for flag in fit.flags if flag.where in ("", f"iso {coefficient.iso:g}")}
    assert set(figures[0].flags) == raised
