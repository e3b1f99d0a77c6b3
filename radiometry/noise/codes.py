"""Findings of the noise method."""

from radiometry.findings import declare, fail, flag, warn

PAIR_LIGHT_DRIFT = flag(
    "Frames of one setting differ by more than 1 % in their means: the light changed between them.",
    "Let the lamp warm up and take the frames one right after the other.",
)
DARK_CLIPPED = flag(
    "More than 0.5 % of a dark frame's samples are 0: noise, DSNU, threshold and dark signal come out too "
    "low.",
    "The frames cannot be corrected: this camera writes no usable black level.",
)
NO_PHOTON_TRANSFER = flag(
    "Fewer than three light levels are usable, or their noise does not grow: no system gain, only results in "
    "DN.",
    "Add pairs at more exposure times below white.",
)
FULL_WELL_NOT_REACHED = flag(
    "No frame is saturated: the stated white level is used as saturation, which may be lower.",
    "Add a pair that is clipped.",
)
READ_NOISE_BELOW_ROUNDING = flag(
    "Rounding hides most of the dark noise: the read noise is read off how often numbers change.",
    "Its uncertainty states how well. Use a higher ISO value to resolve it.",
)
LINEARITY_ERROR_LARGE = flag(
    "A level is more than 10 % off the straight line: other light, another scene, or a wrong exposure time.",
    "Give frames that differ a `scene` of their own, or leave them out.",
)
PRNU_LARGE = flag(
    "PRNU is above 5 %; sensors have 0.3 to 2 %. The lit frames do not show an even surface.",
    "Photograph an even surface out of focus, or draw the region where it is even.",
)
PATTERN_NOT_RESOLVED = flag(
    "DSNU or PRNU is less than two of its standard errors, as variances.", "Add frames of one setting."
)
DARK_CURRENT_COMPENSATED = flag(
    "The dark noise grows faster with time than the dark signal: the camera subtracts its dark current.",
    "Use the dark current from the variance.",
)
UNPAIRED = warn(
    "No other frame has its role, scene, ISO, exposure time and f-number: noise needs two equal frames.",
    "Take it again with the same settings.",
)
PAIR_DRIFT = fail(
    "The light changed by more than 1 % between it and the other frames of its settings.",
    "Let the lamp warm up and take the frames one right after the other.",
)

FINDINGS = declare(globals())
