"""Noise after EMVA 1288: photon transfer, linearity, dark current and nonuniformity from stacks of frames."""

from typing import Final

from radiometry.noise import codes, method
from radiometry.noise.blocks import Features
from radiometry.noise.certificate import CERTIFICATE
from radiometry.noise.key_figures import list_key_figures
from radiometry.noise.plots import PLOTS, split
from radiometry.noise.points import missing
from radiometry.noise.results import Fit
from radiometry.noise.rows import Params
from radiometry.noise.suggestions import find_gaps, plan
from radiometry.noise.verdicts import judge
from radiometry.specification.coefficients import CoefficientKind
from radiometry.specification.grid import Grid
from radiometry.specification.method import MethodSpec, drop_readings, drop_target
from radiometry.specification.roles import DARK, FLAT, LIGHT

__all__ = ["SPEC"]

SPEC: Final = MethodSpec(
    name="noise",
    label="Noise and linearity",
    description="System gain, read noise, dynamic range and linearity, from pairs of equal frames.",
    schema_version=1,
    roles=(FLAT, LIGHT, DARK),
    params=Params,
    result=Fit,
    features=Features,
    whole_frame=True,
    coefficients=(
        CoefficientKind(name="system_gain_dn_per_e", label="System gain", units=("DN/e-",)),
        CoefficientKind(name="read_noise_e", label="Read noise", units=("e-",)),
        CoefficientKind(name="read_noise_dn", label="Read noise", units=("DN",)),
        CoefficientKind(name="full_well_e", label="Saturation capacity", units=("e-",)),
        CoefficientKind(name="linearity_error_rel", label="Linearity error", units=("1",)),
        CoefficientKind(name="snr_max", label="Largest signal-to-noise ratio", units=("1",)),
        CoefficientKind(name="dynamic_range_db", label="Dynamic range", units=("dB",)),
        CoefficientKind(name="dynamic_range_stops", label="Dynamic range", units=("stop",)),
        CoefficientKind(name="dark_current_e_per_s", label="Dark current", units=("e-/s",)),
        CoefficientKind(name="dark_current_dn_per_s", label="Dark current", units=("DN/s",)),
        CoefficientKind(name="dsnu_e", label="Dark signal nonuniformity", units=("e-",)),
        CoefficientKind(name="dsnu_dn", label="Dark signal nonuniformity", units=("DN",)),
        CoefficientKind(name="prnu_rel", label="Photo response nonuniformity", units=("1",)),
    ),
    findings=codes.FINDINGS,
    extract=drop_target(method.extract),
    missing=drop_readings(missing),
    judge=lambda frames, rows, _, params: judge(frames, rows, params),
    plan=drop_readings(plan),
    grid=Grid(rows="exposure_time_s", columns=("iso",)),
    find_gaps=drop_readings(find_gaps),
    fit=drop_readings(method.fit),
    list_coefficients=method.list_coefficients,
    list_key_figures=list_key_figures,
    plots=PLOTS,
    split=split,
    certificate=CERTIFICATE,
)
