"""Findings of the sharpness method."""

from radiometry.findings import declare, error, flag, warn

SHARPNESS_ONCE = flag(
    "A position was taken once: its repeatability is not known, and not in the uncertainty.",
    "Take each position more than once.",
)
SHARPNESS_REPEATS_DIFFER = flag(
    "Frames of a position scatter by more than four times their own uncertainty, and by more than 2 %.",
    "Look for the frame whose focus or position changed.",
)
SHARPENING_SUSPECTED = flag(
    "The edge overshoots by more than 5 % of its step: the image was sharpened, and MTF50 is too high.",
    "Use the raw file, without sharpening.",
)
EDGE_CURVED = flag(
    "The edge departs from a straight line by more than a quarter of a pixel: distortion, or a bent chart.",
    "Fit with `edge_order` 5, which follows it; with 1 the curve is too low.",
)
SHARPNESS_BEYOND_CURVE = flag(
    "The contrast stays above the level as far as it can be measured: there is no such frequency.",
    "Use the curve, which is kept.",
)
SHARPNESS_CENTRE_MISSING = flag(
    "No position lies near the middle of the frame: the falloff cannot be computed.",
    "Add a position in the middle of the frame.",
)
REGION_LEFT_OUT = flag(
    "A channel of a region cannot be used, and was left out.", "`detail` names the channel and the reason."
)
CHART_UNUSABLE = warn(
    "A channel of a region shows no edge or star that can be measured.",
    "`detail` names the channel and the reason, in the words of the list of errors.",
)
PIXEL_PITCH_MISSING = flag(
    "The pixel pitch is not known: nothing can be said in line pairs per millimetre.",
    "Register it with the camera.",
)
BLURRED = warn(
    "It is less sharp than the best repeat of the same position, by a tenth and by three standard "
    "uncertainties.",
    "Take it again; exclude it from the fit if you saw why.",
)
EDGE_NOT_FOUND = error(
    "No single edge runs through the region from one side to the other.",
    "Draw the region around one edge, with 8 pixels and more left on either side of it.",
)
EDGE_ANGLE_UNSUITABLE = error(
    "The edge is under 2 or over 40 degrees from the pixel axes, or has a slope that meets the "
    "pixels at the same places again and again.",
    "Turn the chart or the camera; 5 degrees are best.",
)
EDGE_TOO_SHORT = error(
    "The region is too small, or the edge moves by less than two samples along it.",
    "Draw it longer: 100 pixels are good.",
)
EDGE_TOO_NOISY = error(
    "A pixel's noise is more than a tenth of the edge's step.",
    "Use a lower ISO value, more light, or a chart of more contrast.",
)
CHART_CLIPPED = error(
    "More than 0.1 % of the region is at white or at zero; a clipped edge looks sharper than it is.",
    "Change the exposure.",
)
CHART_CONTRAST_TOO_LOW = error(
    "Bright and dark differ too little: by less than 20 % for an edge, 10 % for a star.",
    "Draw the region on the edge or star, or use a chart of more contrast.",
)
STAR_NOT_FOUND = error(
    "The target's number of cycles does not explain what the region shows.",
    "Correct the number, photograph the star head-on, or draw the region around one star.",
)
STAR_TOO_SMALL = error(
    "The star reaches less than three times as far from its centre as the innermost ring that the sensor can "
    "resolve.",
    "Go closer, or use a star of fewer cycles.",
)

FINDINGS = declare(globals())
