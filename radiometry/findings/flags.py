"""Every flag that a frame, a fit or a measurement may carry: usable, but something to know."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Self


class Flag(StrEnum):
    """What to know about a result. Stable: clients match on it; each has its heading in the documentation."""

    meaning: str

    def __new__(cls, value: str, meaning: str) -> Self:
        """Bind the one-line meaning to the value."""
        member = str.__new__(cls, value)
        member._value_ = value
        member.meaning = meaning
        return member

    # of a frame, when it is accepted
    RENDERED = "rendered", "The image is not raw: somebody's tone curve stands between light and numbers."
    EXPOSURE_NOT_MANUAL = (
        "exposure_not_manual",
        "The camera chose the exposure; the procedure asks for manual.",
    )
    SERIAL_UNKNOWN = (
        "serial_unknown",
        "The file names no serial number: that it is this camera is taken on trust.",
    )
    EXPOSURE_FROM_APEX = "exposure_from_apex", "A nominal value is missing; the APEX value took its place."
    EXPOSURE_SUPPLIED = (
        "exposure_supplied",
        "The file lacks an exposure value; the one typed in took its place.",
    )
    SUPPLIED_EXPOSURE_IGNORED = (
        "supplied_exposure_ignored",
        "The exposure typed in differs from the file's by more than 10 %; the file's was used.",
    )
    # of a frame, when all of it has been read
    IMAGE_PART_EMPTY = (
        "image_part_empty",
        "A part of the image is empty, zeros or below black where a sensor shows noise: data is missing.",
    )
    # of a luminance fit
    DARK_EXPOSURE_DIFFERS = (
        "dark_exposure_differs",
        "Dark and light frames of an ISO differ in exposure time by more than a factor of two.",
    )
    DARK_FROM_BLACK_LEVEL = (
        "dark_from_black_level",
        "An ISO has no dark frame: the file's black level took its place.",
    )
    DARK_FROM_FEW_FRAMES = (
        "dark_from_few_frames",
        "Fewer than three dark frames: their median guards nothing.",
    )
    DARK_VARIES = "dark_varies", "The dark frames of an ISO differ by more than 1 % of its weakest signal."
    DARK_NOT_DARK = (
        "dark_not_dark",
        "A dark frame is brighter than others like it, or than the stated black level: light, or warmth.",
    )
    NONLINEAR = "nonlinear", "The exponent of the power model differs from 1 by more than 0.02."
    IMPLAUSIBLE_K = (
        "implausible_k",
        "K is more than four times off what ISO 12232 expects: wrong black, bit depth, curve or unit.",
    )
    SEMILOG_MODEL = (
        "semilog_model",
        "The semilogarithmic model was asked for: it is wrong for a linear sensor.",
    )
    LAMP_DRIFT = "lamp_drift", "The illuminance readings of a scene spread over more than 2 %."
    RHO_CROSS_CHECK = (
        "rho_cross_check",
        "Luminance and rho E / pi of a scene differ by more than 10 %: a unit, a reading or rho is wrong.",
    )
    GAIN_MAPS_DIFFER = "gain_maps_differ", "Frames of one ISO carry different gain maps."
    FEW_POINTS = "few_points", "Fewer than six points are left for an ISO."
    TOLERANCE_EXCEEDED = "tolerance_exceeded", "A point lies further from the meter than the tolerance."
    SCATTER_EXCEEDS_UNCERTAINTY = (
        "scatter_exceeds_uncertainty",
        "Points scatter more than their stated uncertainties explain: u(K) includes the scatter found.",
    )
    METER_REPEATABILITY_ESTIMATED = (
        "meter_repeatability_estimated",
        "The meter's repeatability was not given: it was estimated from the scatter between scenes.",
    )
    METER_CERTIFICATE_MISSING = (
        "meter_certificate_missing",
        "A meter's calibration uncertainty is not known: u(K) lacks it.",
    )
    APEX_MISSING = (
        "apex_missing",
        "APEX values were asked for, a frame has none: its nominal values were used.",
    )
    # of a multispectral frame and its sunshine readings
    SUNSHINE_READINGS_LEFT_OUT = (
        "sunshine_readings_left_out",
        "Sunshine readings are saturated, dark or of unknown gain: the others were used.",
    )
    SUNSHINE_GAIN_ASSUMED = (
        "sunshine_gain_assumed",
        "The sunshine records state no gain and no integration time: index 1 and 100 ms were assumed.",
    )
    SUNSHINE_GAIN_TABLE_MISSING = (
        "sunshine_gain_table_missing",
        "The file has no usable gain table: only readings at gain index 1 can be used.",
    )
    SUNSHINE_SINGLE_READING = (
        "sunshine_single_reading",
        "There is one sunshine reading: how much it scatters is not known, and not in the uncertainty.",
    )
    SUNSHINE_TIME_UNKNOWN = (
        "sunshine_time_unknown",
        "The reading nearest to the exposure was asked for, and its time is not known: the last was used.",
    )
    SUNSHINE_SCALE_ASSUMED = (
        "sunshine_scale_assumed",
        "The file does not state the unit of its irradiance: it was told by the light sensor's generation.",
    )
    SENSOR_MODEL_SCALE = (
        "sensor_model_scale",
        "SensorModel is on the newer scale, about a thousand times larger: K cannot be compared with others.",
    )
    BLACK_LEVEL_DISAGREES = (
        "black_level_disagrees",
        "SensorModel's black differs from the file's black level by more than 1 % of full scale.",
    )
    # of a reflectance fit
    PANEL_UNEVEN = "panel_uneven", "The signal changes by more than 3 % across the panel's region."
    PANEL_SATURATED = "panel_saturated", "A panel frame is saturated in its region and was left out."
    PANEL_UNCERTAINTY_MISSING = (
        "panel_uncertainty_missing",
        "The uncertainty of the panel's reflectance is not given: u(K) lacks it.",
    )
    PANEL_FROM_FILE = (
        "panel_from_file",
        "The panel's reflectance is the one that the camera itself read off the panel's code.",
    )
    PANEL_DRIFT = "panel_drift", "K differs by more than 3 % between the first and the last panel capture."
    PANEL_ONCE = "panel_once", "The panel was taken at one time only: a drift during the flight is not known."
    PANEL_ONLY = (
        "panel_only",
        "The sunshine sensor was left out: K holds for the light of the panel's capture alone.",
    )
    BAND_MISSING = "band_missing", "A panel capture lacks a band that other captures have."
    SUNSHINE_SERIAL_UNKNOWN = (
        "sunshine_serial_unknown",
        "A file names no sunshine sensor: that it is the calibration's is taken on trust.",
    )
    # of a measured reflectance
    OUTSIDE_PANEL_TIMES = (
        "outside_panel_times",
        "The frame was taken before the first or after the last panel capture: K of the nearest was used.",
    )
    REFLECTANCE_OUT_OF_RANGE = (
        "reflectance_out_of_range",
        "A reflectance is below 0 or above 1: noise, glint, a wrong panel value, or other light.",
    )
    SENSOR_MODEL_DIFFERS = (
        "sensor_model_differs",
        "The file's sensor model is not the calibration's: other firmware, or another camera.",
    )
    # of a vignetting fit
    FLAT_LEFT_OUT = "flat_left_out", "A flat frame was left out of the fit: clipped, uneven, weak or unlike."
    UNEVEN_LIGHT = "uneven_light", "The light changes by more than 2 % across the frame: it was fitted."
    CENTRE_UNCERTAIN = (
        "centre_uncertain",
        "The fitted centre cannot be told from an uneven light, or the falloff is too small to have one.",
    )
    DUST = "dust", "Parts of a flat are darker or brighter than around them: they were left out of the fit."
    WEAK_FLAT = "weak_flat", "A flat's signal is less than a tenth of the span from black to white."
    FALLOFF_NOT_MONOTONIC = "falloff_not_monotonic", "Somewhere the fitted light grows towards the corner."
    FALLOFF_GROWS = "falloff_grows", "The falloff is larger at a higher f-number than at a lower one."
    VIGNETTING_MISFIT = (
        "vignetting_misfit",
        "The flat departs from the fitted curve by more than 0.5 %: the uncertainty holds it.",
    )
    # of a sharpness fit
    SHARPNESS_ONCE = "sharpness_once", "A position was taken once: its repeatability is not known."
    SHARPNESS_REPEATS_DIFFER = (
        "sharpness_repeats_differ",
        "Frames of a position differ by more than four times their own uncertainty: focus or motion.",
    )
    SHARPENING_SUSPECTED = (
        "sharpening_suspected",
        "The edge overshoots by more than 5 %: somebody sharpened the image, and MTF50 flatters the lens.",
    )
    EDGE_CURVED = (
        "edge_curved",
        "The edge departs from a straight line by more than a quarter of a pixel.",
    )
    SHARPNESS_BEYOND_CURVE = (
        "sharpness_beyond_curve",
        "The contrast stays above the level as far as it can be measured: there is no such frequency.",
    )
    SHARPNESS_CENTRE_MISSING = (
        "sharpness_centre_missing",
        "No position lies near the middle of the frame: the falloff cannot be given.",
    )
    REGION_LEFT_OUT = "region_left_out", "A channel of a region cannot be used, and was left out."
    # of a geometry fit
    VIEW_OUTLIER = (
        "view_outlier",
        "A view fits more than three times worse than the median view, and was used all the same.",
    )
    CORNER_WINDOW_WIDE = (
        "corner_window_wide",
        "Squares are so small that the fixed window reaches the next corner: corners are pulled aside.",
    )
    FEW_VIEWS = "few_views", "Fewer than ten views of the board were used."
    COVERAGE_POOR = (
        "coverage_poor",
        "Corners fill less than 70 % of the frame's cells, or end before 80 % of the way to its corner.",
    )
    TILT_POOR = (
        "tilt_poor",
        "Fewer than three views are tilted by 15 degrees or more, or all about one axis.",
    )
    REPROJECTION_LARGE = "reprojection_large", "Corners lie further than 1 px (rms) from where they should."
    PIXELS_NOT_SQUARE = "pixels_not_square", "fx and fy differ by more than 1 %."
    DISTORTION_FOLDS = (
        "distortion_folds",
        "The distortion curve turns back inside the frame: beyond, it means nothing.",
    )
    # of a noise fit
    PAIR_LIGHT_DRIFT = (
        "pair_light_drift",
        "Frames of one setting differ by more than 1 % in their means: the light changed between them.",
    )
    DARK_CLIPPED = (
        "dark_clipped",
        "More than 0.5 % of a dark frame's samples are 0: its noise is cut off, and comes out too small.",
    )
    NO_PHOTON_TRANSFER = (
        "no_photon_transfer",
        "Fewer than three usable light levels: there is no system gain, and nothing in electrons.",
    )
    FULL_WELL_NOT_REACHED = (
        "full_well_not_reached",
        "No frame is saturated: the white level took the place of saturation, which may lie lower.",
    )
    READ_NOISE_BELOW_ROUNDING = (
        "read_noise_below_rounding",
        "Rounding hides the dark noise: the read noise is a limit, it may be anything below.",
    )
    LINEARITY_ERROR_LARGE = (
        "linearity_error_large",
        "A level lies more than 10 % off the straight line: other light, another scene, or the shutter.",
    )
    PRNU_LARGE = (
        "prnu_large",
        "PRNU is above 5 %: the lit frames show something, and no even surface.",
    )
    PATTERN_NOT_RESOLVED = (
        "pattern_not_resolved",
        "DSNU or PRNU does not stand out of the noise: more frames of one setting would show it.",
    )
    DARK_CURRENT_COMPENSATED = (
        "dark_current_compensated",
        "The dark noise grows with time faster than the dark signal: the camera subtracts its dark current.",
    )
    # of a measurement
    OUTSIDE_EXPOSURE_TIMES = "outside_exposure_times", "The exposure time was not among those calibrated."
    OUTSIDE_F_NUMBERS = "outside_f_numbers", "The f-number is outside the calibrated range."
    OUTSIDE_SIGNALS = "outside_signals", "The signal is outside the calibrated range."
    SATURATED = (
        "saturated",
        "More than 0.1 % of the region's samples are saturated: the luminance is a lower bound.",
    )
    BELOW_DETECTION = "below_detection", "The signal is less than three standard errors above dark."
    NO_VIGNETTING_CORRECTION = (
        "no_vignetting_correction",
        "The lens's falloff is not corrected: K holds where the calibration's region lay.",
    )
    ROI_ELSEWHERE = (
        "roi_elsewhere",
        "What was measured reaches beyond the calibration's region, and vignetting is not corrected.",
    )
    OBSERVER_DIFFERS = (
        "observer_differs",
        "The camera looks from where it hung: not the observer of EN 13201 or RP-8.",
    )
    # of a fleet's verdict
    REPEATS_EXCEED_UNCERTAINTY = (
        "repeats_exceed_uncertainty",
        "Repeated calibrations of a camera scatter by more than their stated uncertainties.",
    )
    REPEATS_OF_ONE_DAY = (
        "repeats_of_one_day",
        "All repeats of each camera are of one day: what changes between days is not in the repeatability.",
    )
    BODY_AND_LENS_CONFOUNDED = (
        "body_and_lens_confounded",
        "No swaps link all bodies and lenses: whose difference it is cannot be told.",
    )
    # of a measurement's calibration, as it stands when it is asked for
    CALIBRATION_NOT_PUBLISHED = (
        "calibration_not_published",
        "The measurement was made with a version that nobody has published.",
    )
    CALIBRATION_SUPERSEDED = (
        "calibration_superseded",
        "The version that the measurement was made with has been superseded since.",
    )
    CALIBRATION_REVOKED = (
        "calibration_revoked",
        "The version that the measurement was made with has been revoked since.",
    )


@dataclass(frozen=True, kw_only=True)
class Raised:
    """A flag with where it applies and what was found.

    ``where`` : "iso 3200", "scene level-4", "frame dark-2"; "" for the whole
    ``detail`` : one sentence with the numbers
    """

    flag: str
    where: str
    detail: str
