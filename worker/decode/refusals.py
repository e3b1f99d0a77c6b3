"""Why a file cannot be used, in codes that stay and sentences for the person in the field."""

from enum import StrEnum

from radiometry.findings.errors import Code, InputRejected


class Refusal(StrEnum):
    """Stable: clients match on it."""

    EMPTY_FILE = "empty_file"
    # also of a picture that is a file of another role: see radiometry.frame.acceptance
    NOT_A_RAW_FILE = Code.NOT_A_RAW_FILE.value
    TRUNCATED = "truncated"
    SIZE_MISMATCH = "size_mismatch"
    INCOMPLETE_IMAGE = "incomplete_image"
    FRAME_TOO_LARGE = "frame_too_large"
    FRAME_TOO_SMALL = "frame_too_small"
    LINEAR_RAW = "linear_raw"
    LOSSY_DNG = "lossy_dng"
    UNSUPPORTED_COMPRESSION = "unsupported_compression"
    UNSUPPORTED_LAYOUT = "unsupported_layout"
    DECODER_CRASHED = "decoder_crashed"


_WHAT_TO_DO = {
    Refusal.EMPTY_FILE: "Copy it from the camera's card again.",
    Refusal.NOT_A_RAW_FILE: "Send the camera's raw file (DNG), or a TIFF; of a chart also JPEG or PNG.",
    Refusal.TRUNCATED: "Copy it from the camera's card again and compare the file sizes.",
    Refusal.SIZE_MISMATCH: "The file is damaged: copy it from the camera's card again.",
    Refusal.INCOMPLETE_IMAGE: "Copy it from the camera's card again; its own copy may be damaged too.",
    Refusal.FRAME_TOO_LARGE: "Send a single frame as the camera wrote it.",
    Refusal.FRAME_TOO_SMALL: "Send a whole frame as the camera wrote it, not a thumbnail.",
    Refusal.LINEAR_RAW: "Send the DNG as the camera wrote it, before any conversion.",
    Refusal.LOSSY_DNG: "Set the camera or the converter to lossless or uncompressed DNG and send that.",
    Refusal.UNSUPPORTED_COMPRESSION: "Convert it to an uncompressed or lossless JPEG DNG.",
    Refusal.UNSUPPORTED_LAYOUT: "Send the DNG as the camera wrote it, or a plain 8 or 16 bit TIFF.",
    Refusal.DECODER_CRASHED: "The file may be damaged: copy it from the camera's card again.",
}


def refuse(code: Refusal, what_is_wrong: str) -> InputRejected:
    """Build the refusal; the caller raises it, so that the flow stays visible there."""
    return InputRejected(code, f"{what_is_wrong} {_WHAT_TO_DO[code]}")
