"""Findings of spectral curves."""

from radiometry.findings import error, flag

SPECTRUM_INVALID = error(
    "spectrum_invalid",
    "A lamp or a camera response is neither a name of the library nor a table that can be read.",
    "Send a name of the library, or lines of wavelength in nm and value (R, G and B of a response), at least "
    "10 lines that rise and cover 400 to 700 nm.",
)
SPECTRAL_MISMATCH_UNKNOWN = flag(
    "spectral_mismatch_unknown",
    "The spectrum of the calibration's lamp, of the measured light, or the camera's response is not known: "
    "its effect is assumed.",
    "State what the detail names as not known: `lamp` or `lamp_kind` and `camera_response` with the campaign "
    "of the calibration, `light_source` or `lamp_kind` with the measurement or its campaign; or "
    "`spectral_mismatch_u_rel` where you know better.",
    "measurement",
)
