"""Findings of the vignetting method."""

from radiometry.findings import declare, error, fail, flag

FLAT_LEFT_OUT = flag(
    "A flat frame was left out of the fit: clipped, uneven, weak or unlike the others.",
    "Take it again, above all if it was the only one of its f-number.",
)
UNEVEN_LIGHT = flag(
    "The light changes by more than 2 % across the frame; it was fitted as a plane.",
    "Even out the light, or turn the camera by half a turn between the flats, and state it.",
)
CENTRE_UNCERTAIN = flag(
    "The centre cannot be separated from uneven light, or differs from that of another f-number.",
    "Turn the camera between flats, or add an f-number with more falloff.",
)
LIGHT_NOT_TURNED = flag(
    "The light did not turn in the frame when the camera was turned; the fit does not rely on the turns.",
    "Check `flats_turned_deg` and the order of the frames, and turn the camera, not the light or a diffuser.",
)
DUST = fail(
    "Small parts of a flat are darker or brighter than around them: the fit leaves those parts out.",
    "Clean the sensor, the filter or the target, move the camera between frames, and repeat.",
    "calibration",
)
WEAK_FLAT = flag(
    "A flat's signal is less than a tenth of the span from black to white, where an error of the dark "
    "counts.",
    "Expose longer.",
)
FALLOFF_NOT_MONOTONIC = flag(
    "Somewhere the fitted light grows towards the corner, by more than 0.5 % and three standard errors.",
    "Check the residual map for a compensation in the camera, a reflection or a lens hood.",
)
FALLOFF_GROWS = flag(
    "The falloff is larger at a higher f-number than at a lower one, by more than 0.5 % and three standard "
    "errors.",
    "Some lenses do this; mostly the light or the target changed between the f-numbers: check both.",
)
VIGNETTING_MISFIT = flag(
    "The flat departs from the fitted curve by more than 0.5 % beyond noise; the uncertainty of V includes "
    "it.",
    "Check the residual map: rings are from the lens, slopes and patches from the light.",
)
FLAT_UNUSABLE = error(
    "No flat frame can be used for vignetting, or they are of several lenses; `detail` names every frame "
    "with the reason.",
    "Take them again, or leave the other lens's frames out.",
)

FINDINGS = declare(globals())
