"""Ground coverage of a camera above level ground: near and far edge, sampling distance, footprint."""

import math

from radiometry.records import Record, about

# a ray this close to the horizon (as the sine of its angle below) meets no ground worth a number
_HORIZON = 1e-6

MOST_TILT_DEG = 89.99  # Nearer to the horizon the middle of the picture meets no ground worth a number either


class View(Record):
    """A camera above level ground, its rows level."""

    height_m: float  #: Height above ground [m]
    tilt_deg: float  #: Angle of the line of sight from straight down, 0 to MOST_TILT_DEG [deg]
    focal_length_mm: float
    sensor_width_mm: float  #: Sensor size along the rows and along the tilt [mm]
    sensor_height_mm: float
    pixel_pitch_um: float
    azimuth_deg: float = 0.0  #: Direction of the tilt, clockwise from y of the footprint [deg]

    def __post_init__(self) -> None:
        lengths = (self.height_m, self.focal_length_mm, self.sensor_width_mm, self.sensor_height_mm)
        if not (
            all(math.isfinite(each) and each > 0.0 for each in (*lengths, self.pixel_pitch_um))
            and 0.0 <= self.tilt_deg <= MOST_TILT_DEG
            and math.isfinite(self.azimuth_deg)
        ):
            raise ValueError(f"a view that cannot be: {self}")


class Coverage(Record):
    """Ground coverage of a view; None for what is above the horizon."""

    horizontal_fov_deg: float = about("Fields of view [deg].")
    vertical_fov_deg: float = about("Fields of view [deg].")
    near_m: float = about(
        "Where the middle of the image's lower and upper edge meets the ground, from the point below "
        "the camera along the tilt [m]; negative behind that point."
    )
    far_m: float | None = about(
        "Where the middle of the image's lower and upper edge meets the ground, from the point below "
        "the camera along the tilt [m]; negative behind that point."
    )
    gsd_near_m: float = about(
        "Ground sampling distance of a pixel across the line of sight, in that whole row [m]."
    )
    gsd_centre_m: float = about(
        "Ground sampling distance of a pixel across the line of sight, in that whole row [m]."
    )
    gsd_far_m: float | None = about(
        "Ground sampling distance of a pixel across the line of sight, in that whole row [m]."
    )
    gsd_near_along_m: float = about("Ground sampling distance of a pixel along the tilt [m].")
    gsd_centre_along_m: float = about("Ground sampling distance of a pixel along the tilt [m].")
    gsd_far_along_m: float | None = about("Ground sampling distance of a pixel along the tilt [m].")
    footprint: tuple[tuple[float, float], ...] | None = about(
        "[x, y] of near left, near right, far right, far left, from the point below the camera [m]; y "
        "is azimuth 0."
    )
    horizon_in_view: bool = about("True if the upper edge looks above the ground.")


class _Row(Record, kw_only=False):
    """One image row on the ground: its position, and metres on the ground per millimetre of sensor."""

    ahead_m: float
    across_per_mm: float
    along_per_mm: float


def compute_coverage(view: View) -> Coverage:
    """Compute what a tilted or nadir camera sees of level ground.

    For a row at v on the sensor (up, away from the ground's near side), with tilt
    a, height h and focal length c [1], [2]::

        ahead = h (c sin a + v cos a) / (c cos a - v sin a)
        across, per length on the sensor = h / (c cos a - v sin a)        exact in every point of a row
        along = h c / (c cos a - v sin a)^2                               d ahead / d v
        fov = 2 atan(size / 2 c)

    A ground sampling distance is that times the pixel pitch. For a nadir camera
    both are h s_p / c in the whole image. Where c cos a <= v sin a the row looks at
    the horizon or above it, and no value is computed for it.

    [1] G. Grenzdoerffer, F. Niemeyer, F. Schmidt, Development of four vision camera system for a micro-UAV,
    ISPRS 2012, section 2
    [2] K. Kraus, Photogrammetry, section 5 (equations of a central projection)

    Parameters
    ----------
    view : View
        Camera position and dimensions.

    Returns
    -------
    Coverage
        Fields of view, edges, sampling distances and footprint.
    """
    half = view.sensor_height_mm / 2
    near, centre, far = _find_row(view, -half), _find_row(view, 0.0), _find_row(view, half)
    if near is None or centre is None:
        raise AssertionError("the middle of a picture that is tilted by less than 90 degrees sees the ground")
    pitch_mm = view.pixel_pitch_um * 1e-3
    return Coverage(
        horizontal_fov_deg=_fov_deg(view.sensor_width_mm, view.focal_length_mm),
        vertical_fov_deg=_fov_deg(view.sensor_height_mm, view.focal_length_mm),
        near_m=near.ahead_m,
        far_m=far.ahead_m if far else None,
        gsd_near_m=near.across_per_mm * pitch_mm,
        gsd_centre_m=centre.across_per_mm * pitch_mm,
        gsd_far_m=far.across_per_mm * pitch_mm if far else None,
        gsd_near_along_m=near.along_per_mm * pitch_mm,
        gsd_centre_along_m=centre.along_per_mm * pitch_mm,
        gsd_far_along_m=far.along_per_mm * pitch_mm if far else None,
        footprint=(*_ends(view, near), *reversed(_ends(view, far))) if far else None,
        horizon_in_view=far is None,
    )


def _find_row(view: View, v_mm: float) -> _Row | None:
    tilt = math.radians(view.tilt_deg)
    c, sine, cosine = view.focal_length_mm, math.sin(tilt), math.cos(tilt)
    down = c * cosine - v_mm * sine
    if down <= _HORIZON * math.hypot(c, v_mm):
        return None
    return _Row(
        ahead_m=view.height_m * (c * sine + v_mm * cosine) / down,
        across_per_mm=view.height_m / down,
        along_per_mm=view.height_m * c / down**2,
    )


def _ends(view: View, row: _Row) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the left and the right end of a row on the ground, rotated by the azimuth."""
    turn = math.radians(view.azimuth_deg)
    sine, cosine = math.sin(turn), math.cos(turn)
    reach = row.across_per_mm * view.sensor_width_mm / 2
    left, right = (
        (across * cosine + row.ahead_m * sine, row.ahead_m * cosine - across * sine)
        for across in (-reach, reach)
    )
    return left, right


def _fov_deg(size_mm: float, focal_length_mm: float) -> float:
    return math.degrees(2 * math.atan2(size_mm / 2, focal_length_mm))
