"""The one error that the science raises, and the codes it may carry."""

from enum import StrEnum


class Code(StrEnum):
    """Why an input cannot be used. Stable: clients match on it; each has its heading in docs/errors.md."""

    IMAGE_PART_EMPTY = "image_part_empty"
    ROI_INVALID = "roi_invalid"
    ROI_SELF_INTERSECTING = "roi_self_intersecting"
    ROI_EMPTY = "roi_empty"
    ROI_OUTSIDE_FRAME = "roi_outside_frame"
    NOT_A_RAW_FILE = "not_a_raw_file"
    EXPOSURE_MISSING = "exposure_missing"
    EXPOSURE_IMPLAUSIBLE = "exposure_implausible"
    WRONG_CAMERA = "wrong_camera"
    FIT_INCOMPLETE = "fit_incomplete"
    FIT_FAILED = "fit_failed"
    ISO_NOT_CALIBRATED = "iso_not_calibrated"
    GRID_INVALID = "grid_invalid"
    REGION_MISSING = "region_missing"
    FRAME_NOT_READ = "frame_not_read"
    FRAME_TIME_MISSING = "frame_time_missing"
    SENSOR_MODEL_UNUSABLE = "sensor_model_unusable"
    ATTITUDE_MISSING = "attitude_missing"
    SUNSHINE_MISSING = "sunshine_missing"
    WRONG_SUNSHINE_SENSOR = "wrong_sunshine_sensor"
    PANEL_ANGLE_TOO_LARGE = "panel_angle_too_large"
    PANEL_SATURATED = "panel_saturated"
    BAND_NOT_CALIBRATED = "band_not_calibrated"
    BANDS_NOT_ALIGNED = "bands_not_aligned"
    CAPTURE_INCOMPLETE = "capture_incomplete"
    INDEX_UNDEFINED = "index_undefined"
    OPTION_NOT_OF_METHOD = "option_not_of_method"
    TILT_NOT_CORRECTABLE = "tilt_not_correctable"
    FLAT_UNUSABLE = "flat_unusable"
    VIGNETTING_NOT_CALIBRATED = "vignetting_not_calibrated"
    EDGE_NOT_FOUND = "edge_not_found"
    EDGE_ANGLE_UNSUITABLE = "edge_angle_unsuitable"
    EDGE_TOO_SHORT = "edge_too_short"
    EDGE_TOO_NOISY = "edge_too_noisy"
    CHART_CLIPPED = "chart_clipped"
    CHART_CONTRAST_TOO_LOW = "chart_contrast_too_low"
    STAR_NOT_FOUND = "star_not_found"
    STAR_TOO_SMALL = "star_too_small"


class InputRejected(Exception):  # noqa: N818  the name says whose fault it is
    """An input that cannot be used, whatever is tried: never retried, always explained.

    ``message`` is a sentence for the person who supplied the input: what is wrong and what to do.
    """

    def __init__(self, code: StrEnum, message: str) -> None:
        super().__init__(message)
        self.code = code
        self.message = message
