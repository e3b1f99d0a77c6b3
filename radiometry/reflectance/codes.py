"""Findings of the reflectance method."""

from radiometry.findings import Finding, declare, error, fail, flag, flag_both, flag_measurement, warn

# of a multispectral frame and its sunshine readings
SUNSHINE_READINGS_LEFT_OUT = flag_both(
    "Some sunshine readings are saturated, dark or of unknown gain; the others were used.",
    "`detail` counts them by reason.",
)
SUNSHINE_SECOND_CHANNEL = flag(
    "No reading of the sunshine sensor's channel 0 is valid, mostly because all are saturated: channel 1 "
    "took its place.",
    "Take the panel in the light of the flight: its frames then show how the two channels "
    "compare. The gain table alone is uncertain by 35 %.",
    *("calibration", "measurement", "frame", "verdict"),
)
SUNSHINE_GAIN_ASSUMED = flag_both(
    "The sunshine records state no gain and no integration time: index 1 and 100 ms were assumed.",
    "Use firmware that records them: a change of gain during the flight is not visible.",
)
SUNSHINE_GAIN_TABLE_MISSING = flag_both(
    "The file has no usable gain table: only readings at gain index 1 can be used.",
    "Check the firmware: version 1.7 at times writes no `IrradianceCalibrationMeasurement`.",
)
SUNSHINE_SINGLE_READING = flag_both(
    "There is one sunshine reading, whose scatter is not known: 2.5 % was assumed, unless several frames of "
    "a panel visit show it.",
    "With a light sensor of MicaSense take three or more captures at each panel visit; otherwise "
    "use the mean of several readings.",
)
SUNSHINE_TIME_UNKNOWN = flag_both(
    "The reading nearest to the exposure was requested, and the time of exposure is not known: the last was "
    "used.",
    "Use the mean of the readings.",
)
SUNSHINE_SCALE_ASSUMED = flag_both(
    "The file does not state the unit of its irradiance: it was inferred from the light sensor's generation.",
    "Compare it with `panel_irradiance_w_m2_nm` of the version's points.",
)
HORIZONTAL_IRRADIANCE_LEFT_OUT = flag_both(
    "The irradiance on a level surface that the file states is not trusted for this model and "
    "firmware: the irradiance as oriented was used.",
    "Update the camera's firmware.",
)
TILT_NOT_CORRECTABLE = flag_both(
    "The reading of the sunshine sensor was not converted to a level surface: the file lacks position, time "
    "or attitude, or the sun is under 10 degrees. The tilt is in the uncertainty.",
    "Wait for the GPS fix, and fly when the sun is higher.",
)
ZONE_UNKNOWN = flag_both(
    "The camera's clock states no time zone: the tilt of the sunshine sensor was corrected for the mean of "
    "the zones that its longitude allows, and their spread is in the uncertainty.",
    "State the campaign's time zone.",
)
SUNSHINE_STALE = flag_both(
    "The reading of the light sensor repeats that of an earlier capture although the sensor leans otherwise: "
    "it is not this frame's. A fit leaves the frame out; a measurement levels it as at the panel.",
    "Take the capture again, or wait a second between captures.",
)
SUNSHINE_TILTED = flag_both(
    "The sunshine sensor was more than 3 degrees off level, and its reading was not converted. "
    "The tilt is in the uncertainty.",
    "Fit with `sunshine_surface: level`, from files with position and time.",
)
INCIDENCE_ANGLE_DIFFERS = flag_measurement(
    "The angle of incidence stated for the measurement is not that of the fit.",
    "Leave the angle out unless the surface slopes against the panel.",
)
CLOCK_NOT_SET = flag(
    "The camera's clock was never set: the file's time lies before 2000. The position of the sun is not "
    "known.",
    "Set the clock of the camera, or wait for its GPS fix, before the panel is taken.",
    *("frame", "calibration"),
)
SENSOR_MODEL_SCALE = flag(
    "SensorModel is on the newer scale, about a thousand times larger.",
    "Do not compare this K with K from files of the older scale.",
    *("frame", "calibration"),
)
BLACK_LEVEL_DISAGREES = flag(
    "The black level of SensorModel, or of a DJI camera's XMP, differs from the file's tag by "
    "more than 1 % of full scale; the former was used.",
    "Check with a dark frame which of the two is right.",
    *("frame", "calibration"),
)
# of a fit
PANEL_UNEVEN = warn(
    "The signal changes by more than 3 % across the panel's region: a shadow, a reflection, or the panel's "
    "rim.",
    "Draw the region within the panel, or take the panel again in even light.",
    "calibration",
)
PANEL_SATURATED = Finding(
    "",
    "error",
    ("calibration", "request"),
    "More than 0.1 % of the panel's region is saturated: the frame is left out, and without another there is "
    "no K.",
    "Shorten the exposure or use a darker panel, and take it again.",
)
PANEL_UNCERTAINTY_MISSING = flag(
    "The uncertainty of the panel's reflectance is not given: u(K) lacks what is mostly its largest part.",
    "Send the panel's bands with `standard_uncertainty`, and fit again.",
    *("calibration", "certificate"),
)
PANEL_FROM_FILE = flag(
    "The panel's reflectance is the one that the camera read from the panel's code; it ignores wear and "
    "dirt.",
    "Register the panel with its measured reflectance.",
)
PANEL_OLD = flag(
    "The panel was measured more than two years from the frames: what has changed since is not in "
    "the uncertainty.",
    "Have the panel measured again, and register the new measurement with its day.",
)
PANEL_NOT_IDENTIFIED = flag(
    "No panel frame names its panel, by its tags or by a code: that it is the campaign's is assumed.",
    "Take the panel with its code in the image.",
)
PANEL_DRIFT = flag(
    "K differs by more than 3 % between the first and the last panel capture.",
    "Check for haze, a tilted sensor or a dirty panel. A frame far from both captures is less certain.",
)
IMPLAUSIBLE_REFLECTANCE_K = flag(
    "K is more than 1.5 times off pi: radiance and irradiance in absolute units give R = pi L / E. The panel "
    "was shaded, its reflectance or a unit is wrong, or the sunshine sensor saw another light.",
    "Check the panel's values and its picture; take it again in the light that the sensor sees.",
)
LIGHT_ROUTES_DIFFER = flag(
    "The light sensor and the panel disagree by more than 10 % on the light in this band: radiance of the "
    "panel over its reflectance, in absolute units, is not the sensor's reading.",
    "Where one band differs, check its panel value; where all do, what shaded sensor or panel.",
)
PANEL_ONCE = flag(
    "The panel was taken at one time only: drift during the flight is not known. An assumed one is in the "
    "uncertainty.",
    "Take the panel before and after the flight.",
)
PANEL_TIMES_DOUBTFUL = flag(
    "The times of the panel captures cannot all be right, or do not belong to one flight; `detail` names the "
    "reason. Where they contradict each other K is the mean of the captures, with their whole difference in "
    "the uncertainty.",
    "Set the camera's clock before the first panel capture; fit each day alone.",
)
PANEL_ONLY = flag_both(
    "The sunshine sensor was not used: the result holds for the light of the panel's capture alone.",
    "Fit with the sunshine sensor if the light changed.",
)
BAND_MISSING = flag("A panel capture lacks a band that other captures have.", "Upload the missing file.")
SUNSHINE_SERIAL_UNKNOWN = flag_both(
    "A file names no sunshine sensor: that it is the calibration's is assumed, not checked.",
    "Check that the same sunshine sensor was connected.",
)
# of a frame's verdict
PANEL_WEAK = fail(
    "The panel's signal is less than three standard errors above black, or is not a number.",
    "Take it again in better light.",
)
PANEL_UNKNOWN = warn(
    "The campaign's panel is not registered with a reflectance in this band. The fit takes that "
    "of the file, which the certificate names as missing; without it the band is left out.",
    "Register the panel with this band and name it in the campaign.",
    "certificate",
)
SUNSHINE_UNUSABLE = warn(
    "The file has no valid reading of a sunshine sensor; `detail` gives the reason.",
    "Such a frame can only be used with `normalisation: panel_only`.",
)
# of a measurement
LIGHT_CHANGED = flag_measurement(
    "The sunshine sensor shows less than 0.7 or more than 1.4 times the light of the panel's "
    "captures. The reading divides the change out. Where the diffuse fraction was assumed for the "
    "tilt, the sky may have had any.",
    "Take the panel in the light of the flight; measure again with a visit in that light.",
)
OUTSIDE_PANEL_TIMES = flag_measurement(
    "The frame was not taken between two panel captures, or a time is not known: K of the "
    "nearest, or the mean, was used. `drift` grows with the time to the nearest.",
    "Take the panel before and after the flight.",
)
REFLECTANCE_OUT_OF_RANGE = flag_measurement(
    "A reflectance is below 0 or above 1; it was not clipped.",
    "Check for noise in dark areas, glint, other light, or a wrong panel value.",
)
SENSOR_MODEL_DIFFERS = flag_measurement(
    "The file's sensor model is not the calibration's: other firmware, or another camera.",
    "Take the panel again with this firmware.",
)
# of what gives no result
SENSOR_MODEL_UNUSABLE = error(
    "The bands of this camera are not read, or the file does not state how its sensor or lens "
    "responds, or states what no sensor does; `detail` names it.",
    "Upload the file as the camera wrote it.",
    *("file", "request"),
)
PANEL_ANGLE_TOO_LARGE = error(
    "The angle of incidence is above 60 degrees, where one degree changes the result by more than 3 %.",
    "Level the panel, or wait for a higher sun.",
)
SUNSHINE_MISSING = error(
    "There is no valid sunshine reading; `detail` gives the reason.",
    "Fit with `normalisation: panel_only`, whose K holds for one light, or take the frames again with the "
    "sensor connected.",
)
WRONG_SUNSHINE_SENSOR = error(
    "The frames are of several sunshine sensors, or of another one than the version's.",
    "Leave the frames of the others out, or take the panel with this pair.",
)
BAND_NOT_CALIBRATED = error(
    "The calibration has no K for the frame's band, or a band that an index needs is missing.",
    "Take the panel in that band, with its reflectance, or upload the capture's other files.",
)
ALIGNMENT_NOT_REFINED = flag_measurement(
    "The bands were aligned by the lens data of their files alone: too few edges agree, as on "
    "water, on bare ground, and close to a scene with depth. 5 pixels are assumed to remain.",
    "Use captures of structured ground from flight height, or a region that is even around its border.",
)
FORMULA_INVALID = error(
    "The formula of an index cannot be used; `detail` names the part, or the bands that there are.",
    "Write bands, numbers, + - * / ** and parentheses.",
)
RADIANCE_UNKNOWN = error(
    "The file states no absolute calibration of its sensor, from which its radiance would follow.",
    "Ask for the reflectance. Cameras of MicaSense state a `RadiometricCalibration`.",
)
RADIANCE_UNCERTAINTY_UNKNOWN = flag_measurement(
    "The radiance follows from the manufacturer's calibration, whose uncertainty the file does not state: "
    "the uncertainty is that of the pixels' noise alone.",
    "Compare it with a radiance standard.",
)
INDEX_UNDEFINED = error(
    "The index is not defined for the region's reflectances: a divisor is zero, or below zero for a named "
    "index.",
    "Draw the region on something that reflects.",
)
BANDS_NOT_ALIGNED = error(
    "The files cannot be aligned: they are not bands of one capture, or do not state "
    "`RigRelatives` and too few edges agree between them.",
    "Align them with photogrammetry software and compute the index there.",
)
FINDINGS = declare(globals())
