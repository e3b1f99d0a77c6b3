"""Findings that keep a file from being read, raised while it is decoded."""

from functools import partial

from radiometry.findings import declare, error

_refusal = partial(error, where="file")

EMPTY_FILE = _refusal("The file has no bytes.", "Copy it from the camera's card again.")
NOT_A_RAW_FILE = _refusal(
    "The file is not in a known raw format; or it is a JPEG or PNG that is not of a chart.",
    "Send the camera's raw file (DNG) or a TIFF; for the role `chart` also a JPEG or PNG.",
)
TRUNCATED = _refusal(
    "The file ends before its image does.", "Copy it from the camera's card again and compare the file sizes."
)
SIZE_MISMATCH = _refusal(
    "The sizes that the file states do not agree with its content.",
    "The file is damaged: copy it from the camera's card again.",
)
LEVELS_CONTRADICTORY = _refusal(
    "The black level that the file states is not below its white level.",
    "Send the file as the camera wrote it: a program may have changed its levels.",
)
INCOMPLETE_IMAGE = _refusal(
    "The pixel data is not proved complete by its own checksum, end marker or digest.",
    "Copy it from the camera's card again; the card's own copy may be damaged too.",
)
FRAME_TOO_LARGE = _refusal(
    "More than 250 megapixels, 65535 pixels a side, or tiles far larger than the image.",
    "Send a single frame as the camera wrote it.",
)
FRAME_TOO_SMALL = _refusal(
    "Fewer than 16 pixels a side.", "Send a whole frame as the camera wrote it, not a thumbnail."
)
LINEAR_RAW = _refusal(
    "A converter interpolated the colours: the sensor's mosaic is no longer in the file.",
    "Send the DNG as the camera wrote it, before any conversion.",
)
LOSSY_DNG = _refusal(
    "The DNG is compressed with loss.",
    "Set the camera or the converter to lossless or uncompressed DNG and send that.",
)
UNSUPPORTED_COMPRESSION = _refusal(
    "The image uses a compression that is not read.", "Convert it to an uncompressed or lossless JPEG DNG."
)
UNSUPPORTED_LAYOUT = _refusal(
    "The image is not a single Bayer or grey mosaic of samples.",
    "Send the DNG as the camera wrote it, or a plain 8 or 16 bit TIFF.",
)
DECODER_CRASHED = _refusal(
    "The process that read the file ended, took too long or needed too much memory.",
    "The file may be damaged: copy it from the camera's card again.",
)

FINDINGS = declare(globals())
