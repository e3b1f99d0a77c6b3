"""A luminance coefficient with round numbers."""

from radiometry.frame.statistics import measure_signal
from radiometry.luminance.application import apply_to_signal, choose_coefficient
from radiometry.luminance.results import Coefficient

COEFFICIENT = Coefficient(
    iso=3200.0,
    model="proportional",
    channel="green",
    exposure_basis="nominal",
    luminance_k=30.0,
    luminance_k_standard_uncertainty=0.5,
    luminance_k_unit="DN*m2/(cd*s)",
    expanded_uncertainty=1.0,
    coverage_factor=2.0,
    effective_dof=None,
    dark_signal_dn=256.0,
    dark_signal_standard_uncertainty_dn=0.5,
    black_level_dn=256.0,
    white_level_dn=4095.0,
    parameter_names=("luminance_k",),
    parameters=(30.0,),
    covariance=((0.16,),),
    meter_calibration_u_rel=0.01,
    f_number_u_rel=0.015,
    exposure_time_u_rel=0.005,
    exposure_times_s=(0.01, 0.02),
    f_number_range=(2.8, 8.0),
    signal_range_dn=(100.0, 3000.0),
    rhs_range=(1.0, 100.0),
)


def apply_coefficient(statistics, *, exposure, coefficients):
    coefficient = choose_coefficient(coefficients, iso=exposure.iso)
    signal = measure_signal(statistics, channel=coefficient.channel)
    return apply_to_signal(signal, exposure=exposure, coefficient=coefficient)
