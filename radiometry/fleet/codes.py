"""Findings of the comparison of cameras."""

from radiometry.findings import declared, flag

REPEATS_EXCEED_UNCERTAINTY = flag(
    "repeats_exceed_uncertainty",
    "Repeated calibrations of a camera scatter by more than their stated uncertainties explain, with 99 %.",
    "Check for drift, an error that was not stated, or one wrong campaign. The verdict uses the larger "
    "scatter.",
    "fleet",
)
REPEATS_OF_ONE_DAY = flag(
    "repeats_of_one_day",
    "All repeats of each camera are from one day: changes between days are not in the repeatability.",
    "Repeat on another day.",
    "fleet",
)
BODY_AND_LENS_CONFOUNDED = flag(
    "body_and_lens_confounded",
    "No swaps link all bodies and lenses: a difference cannot be assigned to the body or to the lens.",
    "Calibrate bodies with swapped lenses. The verdict on the pairs as they are holds.",
    "fleet",
)

FINDINGS = declared(globals())
