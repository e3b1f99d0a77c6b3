"""Findings of the luminance method."""

from radiometry.findings import declare, error, fail, flag, flag_both, flag_measurement, reason, warn
from radiometry.spectral import mismatch

# of a fit
DARK_FROM_FEW_FRAMES = flag(
    "There are fewer than three dark frames: a median of two does not protect against an outlier.",
    "Take three or more.",
)
DARK_VARIES = flag(
    "The dark frames of an ISO value differ by more than 1 % of its weakest signal.",
    "Check for stray light or a sensor that warmed up, and take them again.",
)
NONLINEAR = flag(
    "The exponent of the power model differs from 1 by more than 0.02.",
    "Check the residuals for stray light, a wrong dark signal, a rendered image or a wrong reading.",
)
IMPLAUSIBLE_K = flag(
    "K differs by more than a factor of four from the value expected from ISO 12232.",
    "Check the unit, the bit depth, the black level and whether a tone curve was applied.",
)
SEMILOG_MODEL = flag(
    "The semilogarithmic model was requested: it is wrong for a linear sensor.",
    "Use it only to reproduce an old report, and `proportional` to measure.",
)
LAMP_DRIFT = warn(
    "The illuminance readings of a scene spread over more than 2 % of their mean.",
    "Let the lamp warm up, check its supply, and repeat the frames and readings of this light level.",
    "calibration",
)
READING_FAR_FROM_FRAMES = flag(
    "A meter reading was taken more than an hour from the frames of its scene: the lamp is "
    "assumed to have changed no more than during a scene.",
    "Correct the time of the reading or the camera's clock, or repeat the light level.",
)
RHO_CROSS_CHECK = flag(
    "Luminance and rho E / pi of a scene differ by more than 10 %.",
    "Check the unit, the reading and rho; the surface may not be matt.",
)
GAIN_MAPS_DIFFER = flag(
    "Frames of one ISO value contain different gain maps, which are never applied.",
    "Use one firmware and one mode.",
)
OFFSET_SIGNIFICANT = flag_both(
    "The affine model is better than the proportional one by more than 10 in AICc: the signal has an offset.",
    "Look for stray light, a wrong dark signal or a wrong black level, and take the frames again. "
    "Weak signals are wrong by about the offset.",
)
OUTLIERS_DISCOUNTED = flag(
    "The robust fit gives frames less than a tenth of their weight, because they lie apart from all others.",
    "Look at these frames: a wrong scene, a shadow, a shutter that failed. Exclude them with the reason.",
)
TOLERANCE_EXCEEDED = flag(
    "A point is further from the meter than the tolerance, or K less certain than the decision rule accepts.",
    "Find the point in `points`; do not exclude it without a reason. `guarded` needs a smaller u(K).",
)
METER_REPEATABILITY_ESTIMATED = flag(
    "The meter's repeatability was not given; it was estimated from the scatter between scenes.",
    "This is usual and not a fault; give `meter_repeatability_rel` if you know it.",
)
METER_CERTIFICATE_MISSING = flag(
    "A reading names no meter, or its meter has no certificate: K is relative only, its uncertainty lacks "
    "the error of the meter's scale.",
    "Register the meter with its certificate, and fit again; until then use ratios of luminances.",
    *("calibration", "measurement", "certificate"),
)
APEX_MISSING = flag(
    "APEX values were requested and a frame has none: its nominal values were used.",
    "Choose the basis `nominal`: the two do not mix.",
)
# of a frame's verdict
SCENE_MISSING = fail(
    "The frame has no `scene`, so no meter reading can be assigned to it.",
    "`PATCH` the frame with its `scene`.",
)
READING_MISSING = reason(
    "pending",
    "Its scene has no luminance reading: the fit leaves the frame out.",
    "Send the reading, or correct the name of the scene.",
)
READING_OFF = warn(
    "A reading and the frames of its scene disagree; from a factor of two on, no fit begins.",
    "Correct the reading or its unit, keep it with a `reason`, or leave out the frames of the scene.",
    "campaign",
)
NEARLY_CLIPPED = warn(
    "The highlights of the region come within 5 % of white.",
    "Reduce the light so that they are at 80 % of the span from dark to white.",
)
SCENE_DOUBTFUL = warn(
    "The frame is more than 25 % brighter or darker than the median of its scene's frames at this ISO value.",
    "Correct the scene with `PATCH`; if it is right, something moved or the lamp changed: take it again.",
)
# of a measurement
OUTSIDE_EXPOSURE_TIMES = flag_measurement(
    "The exposure time was not among those calibrated.",
    "Calibrate with this exposure time as well, dark frames included, or use one of the calibrated times.",
)
OUTSIDE_F_NUMBERS = flag_measurement(
    "The f-number is outside the calibrated range.",
    "Calibrate with this f-number as well, or use one within the range.",
)
F_NUMBER_NOT_CALIBRATED = flag_measurement(
    "The f-number is within the calibrated range but was not calibrated: K of the ISO value is "
    "used, with the whole uncertainty of a nominal f-number.",
    "Calibrate with this f-number as well, or use a calibrated one.",
)
OUTSIDE_SIGNALS = flag_measurement(
    "The signal is outside the calibrated range, where linearity was not tested.",
    "Choose time and aperture so that it is inside, or calibrate light levels that reach it.",
)
NO_VIGNETTING_CORRECTION = flag_measurement(
    "The light falloff of the lens is not corrected: K holds at the calibration's region.",
    "Fit K with a vignetting version from flat fields, or measure at the calibration's region.",
)
ROI_ELSEWHERE = flag_measurement(
    "The measured area reaches beyond the calibration's region, and vignetting is not corrected.",
    "Turn the camera until the surface is at the calibration's region, or calibrate with a region there.",
)
OBSERVER_DIFFERS = flag_measurement(
    "The camera is above the road, not at the observer's position of EN 13201 or RP-8 (1.43° or less). On "
    "one simulated road U_o was 0.386 from above, and 0.427 (surface R1) or 0.266 (R4) for the driver: "
    "neither values nor ratios carry over. That road is dry; of a wet one EN 13201-2 asks a U_o of 0.15 "
    "instead of 0.40.",
    "For results according to EN 13201 or RP-8, measure from the observer's position with a luminance meter.",
)
FRAMES_DISAGREE = flag_measurement(
    "The averaged frames differ beyond their noise, and by 1 % or more: the light or the view changed.",
    "Keep the camera still and the light steady, avoid flicker, and take more frames; or measure "
    "them one by one.",
)
FLICKER_UNKNOWN = flag_measurement(
    "The mains frequency is not stated, and the exposure is short against its period: the budget "
    "assumes 50 or 60 Hz, whichever errs more.",
    "State `mains_frequency_hz` and `lamp_kind` with the campaign or the measurement, or expose "
    "for a whole number of half periods: 1/10 s suits 50 and 60 Hz.",
)
STRAY_LIGHT_UNKNOWN = flag_measurement(
    "The glare of the lens is not known: minimum and U_o may be too large. The budget assumes up "
    "to 4 % of the frame's mean luminance.",
    "Photograph a black trap in a bright scene and state its luminance over that of the whole frame as "
    "`glare_share`.",
)
MIXED_SURFACE = flag_measurement(
    "Mean and median differ: the light changes steeply within the area, or it covers unlike "
    "parts, such as a road marking, a lamp or the light of a passing car.",
    "Look at the map, draw on one surface, take more cells, or measure a frame without traffic.",
)
MIXED_LIGHT = flag_measurement(
    "The raw colours of the cells differ: unlike lamps or surfaces lie side by side. The budget "
    "holds one spectral error, the same for all cells.",
    "Measure the part that each kind of lamp lights by itself, stating its `light_source`, and "
    "report no ratios between the parts.",
)
CORNERS_IMPLAUSIBLE = flag_measurement(
    "No camera sees a rectangle of the stated sides with these corners.",
    "Check the order of the corners, of lanes the first two along them, and the lengths in metres.",
)
GRID_MIRRORED = flag_measurement(
    "The corners run counterclockwise: the cells are the surface's mirror image. Values and "
    "uniformities are not affected.",
    "Give the corners clockwise as the surface is seen from above.",
)
CELLS_SMALL = flag_measurement(
    "Cells are narrower than 4 px: blur mixes neighbours, so that minimum and uniformity may be too large.",
    "Take fewer rows or columns, fly lower, or use a longer lens.",
)
DIFFUSE_ASSUMED = flag_measurement(
    "The illuminance takes the surface as matt.",
    "Measure the reflectance of this dry surface, and state its uncertainty as `reflectance_u_rel`; of a wet "
    "or polished surface, measure the illuminance with a meter.",
)
ISO_NOT_CALIBRATED = error(
    "The frame was taken at an ISO value for which this calibration has no K; K is not interpolated.",
    "Calibrate at this ISO value, or use one of the calibrated values.",
)
GRID_INVALID = error(
    "The grid of cells cannot be laid over a surface.",
    "Send four corners in order around it, no three on one line, and a number of rows and columns within "
    "bounds.",
)

FINDINGS = (*mismatch.FINDINGS, *declare(globals()))
