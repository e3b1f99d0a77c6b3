"""Findings that no method owns: of frames, regions, readings of files, and of what several methods do."""

from radiometry.findings import Finding, declare, error, fail, flag, flag_both, flag_measurement, reason, warn

# of a frame, when it is accepted
RENDERED = warn(
    "The image is not raw: a tone curve has been applied between the light and the numbers.",
    "Send the camera's own raw file.",
    *("frame", "calibration", "measurement"),
)
STATISTICS_FROM_TABLE = flag(
    "The statistics are a row of a table: the pixels were not seen, and nothing vouches for them.",
    "Send the camera's raw files where they still exist.",
    *("frame", "calibration", "measurement"),
)
PIXELS_MISSING = error(
    "The frame is a row of a table, which has no pixels to measure.", "Send the camera's raw file."
)
HEIGHT_UNUSABLE = error(
    "The height above the ground is stated twice, or the ground does not lie below the file's altitude.",
    "State either `height_above_ground_m`, or `ground_altitude_m` in the height system of the file's "
    "altitude.",
)
EXPOSURE_NOT_MANUAL = warn(
    "The camera chose the exposure; the procedure asks for manual exposure.",
    "Set the exposure mode to manual and automatic ISO off, and take the frame again.",
    "frame",
)
READING_WITHOUT_FRAMES = flag(
    "A scene has meter readings and no frames: the fit uses neither.",
    "Correct the name of the scene, upload the frames, or withdraw the readings.",
    "campaign",
)
SERIAL_UNKNOWN = flag(
    "The file contains no serial number: that it is from this camera is assumed, not checked.",
    "Check that the file is from this camera.",
    *("frame", "calibration", "measurement"),
)
BLACK_LEVEL_ASSUMED = flag(
    "The raw file states no black level: 0 was assumed.",
    "Take dark frames, and send the camera's own file: a converter may have dropped the level.",
    *("frame", "calibration", "measurement"),
)
SAMPLES_ABOVE_WHITE = flag(
    "The file has samples above its white level. They count as saturated.",
    "A program may have changed the white level; some cameras state one below their largest sample.",
    "frame",
)
EXPOSURE_FROM_APEX = flag(
    "A nominal exposure value is missing; the APEX value was used, which differs from it by up to 7 %.",
    "Upload the frame again with the nominal value from your notes.",
    "frame",
)
EXPOSURE_SUPPLIED = flag(
    "The file lacks an exposure value; the value entered with the upload was used.",
    "Check it against your notes.",
    "frame",
)
SUPPLIED_EXPOSURE_IGNORED = flag(
    "The exposure value entered differs from the file's by more than 10 %; the file's was used.",
    "One of the two is wrong: check your notes, and that the file is of this frame.",
    "frame",
)
IMAGE_PART_EMPTY = Finding(
    "",
    "error",
    ("frame", "verdict", "measurement", "request"),
    "A part of the image is empty, zeros or below black where a sensor shows noise: data is missing.",
    "Copy the file from the card again, or take the frame again.",
)
FRAME_LEFT_OUT = warn(
    "The method has no use for what this file shows, such as a thermal band; it is stored and left out.",
    "Nothing: the other files of the capture are used.",
    "frame",
)
WRONG_CAMERA = error(
    "The file states another make, model or serial number than the camera that it is used for.",
    "Upload it to its own campaign, or register the camera with the names that it writes.",
    *("file", "request"),
)
EXPOSURE_MISSING = error(
    "The file lacks the exposure time, f-number or ISO value, or states zero.",
    "Enter the value from your notes (`exposure_time_s`, `f_number`, `iso`) with the upload or "
    "for the frame.",
    *("file", "request"),
)
EXPOSURE_IMPLAUSIBLE = error(
    "An exposure value is outside the range of any camera.",
    "Enter the right one, with the upload or for the frame.",
    *("file", "request"),
)
# of a region or a grid
ROI_INVALID = error(
    "The region is not a polygon: it has fewer than three different points, all of them on one "
    "line, or it cannot be read.",
    "Send three or more corners, or one ImageJ call.",
)
ROI_SELF_INTERSECTING = error(
    "The polygon crosses or touches itself.", "Draw its corners in order around the area."
)
ROI_EMPTY = error(
    "No pixel's centre lies in the region, or it is too small for the method.",
    "Draw it larger.",
    *("frame", "request"),
)
ROI_OUTSIDE_FRAME = error(
    "A corner of the region lies outside the image.",
    "Draw the region again, or give the frame a region of its own.",
    *("frame", "request"),
)
# of a frame in its campaign, before its statistics are looked at
NOT_READ = reason(
    "pending", "The file has arrived and is stored; it has not been read yet.", "Ask again in a few seconds."
)
NO_REGION = reason(
    "pending",
    "Neither the frame nor its campaign has a region (ROI).",
    "Draw it on the preview and `PUT` it to the campaign, or to the frame where the camera has moved.",
)
NOT_EXTRACTED = reason(
    "pending",
    "The region is known; its statistics are not there yet.",
    "Ask again in a few seconds. A board is looked for once the campaign describes it.",
)
REFUSED = fail(
    "The file cannot be used; `detail` is the sentence of its `refusal`.",
    "Follow the entry of its code in the list of errors.",
)
ROI_UNFIT = fail(
    "The region leaves this frame, contains no pixel's centre, or is too small for what is measured in it.",
    "Draw it again, or give this frame a region of its own.",
)
FORMAT_DIFFERS = fail(
    "Width, height or colour filter differ from those of most other frames.",
    "Set the camera as for the others and take it again.",
)
LENS_DIFFERS = warn(
    "The file names another lens than most frames of the campaign do.",
    "Leave the frame out, or send it to a campaign of its own: what is calibrated holds for one lens.",
)
ROLE_UNUSED = warn(
    "The campaign's fit does not use frames of this role.",
    "Correct the role of the frame, or upload the file to its own campaign.",
)
# of the signal in its region
CLIPPED = fail(
    "More than 0.1 % of the region's samples are saturated.",
    "Shorten the exposure time, close the aperture or lower the ISO value, and take the frame again.",
)
TOO_DARK = fail(
    "The signal is less than three standard errors above dark: the fit leaves the frame out.",
    "Take a longer time, a larger aperture or a brighter level.",
)
WEAK_SIGNAL = warn(
    "The signal is above dark, but too small to have much weight.",
    "Take a longer time, a larger aperture or a brighter level.",
)
UNEVEN = fail(
    "The region is not one evenly lit surface.",
    "Check the preview: draw the region again, or even out the light.",
)
REDUNDANT = fail(
    "Another frame of the campaign has the same settings and scene, or the same samples.",
    "Use another aperture or another light level instead of a repeat.",
)
# of dark frames
DARK_EXPOSURE_DIFFERS = flag(
    "Dark and light frames of an ISO value differ in exposure time by more than a factor of two.",
    "Take dark frames at the exposure times of the light frames: dark current grows with time.",
)
DARK_FROM_BLACK_LEVEL = flag(
    "There is no dark frame of this ISO value: the black level that the file states was subtracted.",
    "Take three dark frames.",
)
DARK_NOT_DARK = fail(
    "A dark frame is brighter than others like it, or than the stated black level: light, or a warm sensor.",
    "Switch the lamp off, cover the lens and take it again.",
    "calibration",
)
# of a fit
FEW_POINTS = flag(
    "Fewer than six points are left for an ISO value.", "Check why points were left out, and add frames."
)
SCATTER_EXCEEDS_UNCERTAINTY = flag(
    "Points scatter more than their stated uncertainties explain; the uncertainty includes the scatter "
    "found.",
    "Check the residuals for a frame, a reading or an aperture that differs from the others.",
)
SCATTER_IMPLAUSIBLE = flag_both(
    "The points scatter by more than 5 %, which no meter and no shutter does.",
    "Check for surfaces of different colours, an offset (stray light, wrong dark signal), and "
    "frames or readings of a wrong scene.",
)
FIT_INCOMPLETE = error(
    "The rows do not suffice for the result, for example because a reading was withdrawn meanwhile.",
    "Add what `detail` names, then ask again.",
)
TARGET_MISSING = flag(
    "What is photographed has not been described.",
    "Describe it in the campaign's `target`.",
    "campaign",
)
COULD_IMPROVE = flag(
    "More or other frames, readings or statements would make the result better.",
    "Add what `detail` names; a fit does not need it.",
    "campaign",
)
FIT_FAILED = error(
    "The fit did not converge.",
    "Check for a wrong reading or unit.",
)
VIGNETTING_NOT_CALIBRATED = error(
    "The vignetting calibration does not hold for an f-number outside the range of its flats, "
    "another channel or image size, or an export that cannot represent the fit.",
    "Take flats at that f-number, or use one within the range.",
)
# of a measurement
SATURATED = flag_measurement(
    "More than 0.1 % of the region's samples are saturated: the result is a lower bound.",
    "Take another frame at a quarter of the exposure time.",
)
BELOW_DETECTION = flag_measurement(
    "The signal is less than three standard errors above dark.",
    "Expose longer or open the aperture, or average several frames.",
)
CALIBRATION_NOT_PUBLISHED = flag_measurement(
    "The measurement used a calibration version that has not been published.",
    "Have the version reviewed and published, or measure with the one in force.",
)
CALIBRATION_SUPERSEDED = flag_measurement(
    "The calibration version that the measurement used has been replaced since.",
    "Measure the frame again: another version is in force now.",
)
CALIBRATION_REVOKED = Finding(
    "",
    "warn",
    ("measurement", "request"),
    "The calibration version, or the vignetting version behind it, has been revoked.",
    "Measure again with a version that is not revoked. A revoked version is not published again.",
    409,
)
REGION_MISSING = error(
    "There is no region to measure in.", "Send one, or give the frame or its campaign one."
)
FRAME_NOT_READ = error(
    "The frame has not been read yet, or it was refused.",
    "Wait until its job has ended and ask again, or see its `refusal`.",
)
FRAME_TIME_MISSING = error(
    "The file does not state when it was taken, so the version in force then cannot be chosen.",
    "Name a `calibration_id`.",
)
CAPTURE_INCOMPLETE = error(
    "An index needs two bands of one capture; the campaign lacks one of them, or it has not been read yet.",
    "Upload the capture's other files to the same campaign.",
)
FRAMES_DIFFER = error(
    "The frames to be averaged differ in exposure, size, region, scene, campaign or calibration "
    "version, or one is named twice.",
    "Average frames of one campaign that were taken one after another with the same settings, and send the "
    "region with the request.",
)
OPTION_NOT_OF_METHOD = error(
    "The measurement asks for something that its method does not have, such as an index of a "
    "luminance; or the frame's campaign has a method that measures nothing.",
    "Leave the option out, or upload the frame with `role=field` to a campaign of luminance or reflectance.",
)
ATTITUDE_MISSING = error(
    "The file has no two records of yaw, pitch and roll with their times, as a Sequoia writes them.",
    "Enter the rotation rate in `POST /v1/tools/motion` instead.",
)
LATERAL_COLOUR_LARGE = flag(
    "Red or blue lies more than 1 px, and two standard uncertainties, from green at an edge or "
    "within the corners of a board.",
    "Measure colour ratios of small features away from the corners, or correct each channel by its curve.",
)

FINDINGS = declare(globals())
