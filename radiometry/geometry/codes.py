"""Findings of the geometry method and of rigs."""

from radiometry.findings import declare, error, fail, flag, warn

VIEW_OUTLIER = flag(
    "A view fits more than three times worse than the median view, and worse than 0.3 px; it was used.",
    "Check its image for blur, a bent board or glare; leave it out, or set `reject_above_px`.",
)
VIEW_MIRRORED = flag(
    "A picture is mirrored or turned by 180 degrees against the others; it was left out.",
    "Use the pictures as the camera wrote them: a viewer may have turned a copy.",
)
MIRROR_NOT_EXCLUDED = flag(
    "A rendered picture may be mirrored or turned by 180 degrees unseen, and the principal point "
    "be wrong by more than its standard uncertainty.",
    "Use pictures as the camera wrote them, a ChArUco board, or a checkerboard with two odd and "
    "different numbers of inner corners.",
)
CORNER_WINDOW_WIDE = flag(  # of versions up to 0.3.0
    "Squares are so small that the fixed window reaches the edges of the next corner, which displace this "
    "one.",
    "Fit again: the window now follows from the spacing of the corners.",
)
FEW_VIEWS = flag("Fewer than ten views of the board were used.", "Add views.")
COVERAGE_POOR = flag(
    "Corners fill less than 70 % of the frame's cells, or end before 80 % of the way to its corner.",
    "Add views with the board at the edges and in the corners: beyond its corners the curve is extrapolated.",
)
TILT_POOR = flag(
    "Fewer than three views are tilted by 15 degrees or more, or all tilted views turn about one axis.",
    "Add views tilted by 15 degrees or more about both axes.",
)
REPROJECTION_LARGE = flag(
    "The distance between the corners found and predicted is above 1 px (rms).",
    "Check that the board is flat and the images sharp; a fisheye does not follow this model.",
)
PIXELS_NOT_SQUARE = flag(
    "fx and fy differ by more than 1 %.",
    "Pixels of sensors are square: check for a resampled video frame, and add views that determine both.",
)
DISTORTION_FOLDS = flag(
    "The radial polynomial turns back inside the frame, which no lens does.",
    "Bring the board into the corners, or free fewer `radial_terms`.",
)
BOARD_NOT_FOUND = fail(
    "The board was not found: the fit leaves the frame out.",
    "Show all of a checkerboard with a white margin, sharp, flat and free of glare, and check the "
    "numbers of its inner corners.",
    "frame",
)
BOARD_BLURRED = warn(
    "The edges of the board's squares rise (10 to 90 %) over more than 5 px: out of focus, or moved.",
    "Hold still, and use more light and a shorter time.",
)
BOARD_SMALL = warn("The board spans less than 5 % of the frame.", "Come closer, or use a larger board.")


RIG_INCOMPLETE = error(
    "Pictures that were taken together do not link all cameras of the rig.",
    "Take three or more pictures of the board with all cameras at once, and give those of one trigger one "
    "`scene`.",
)
TRIGGER_LEFT_OUT = flag(
    "A picture does not show the board where the rig's other pictures put it; it was left out.",
    "Check its `scene`: it may belong to another trigger, or the board moved.",
    "fleet",
)
RIG_NOT_RIGID = flag(
    "The orientation scatters from trigger to trigger by more than four times what its corners explain.",
    "Put rig and board down for every picture, and check mounts and synchronisation.",
    "fleet",
)
FEW_TRIGGERS = flag(
    "Fewer than six triggers were used for a camera.",
    "Take ten or more, with the board near and far and tilted about both axes.",
    "fleet",
)

FINDINGS = declare(globals())
