"""Distortion as an entry of Lensfun's database."""

import math

import numpy as np
import scipy
from numpy.typing import NDArray

from radiometry.frame.lensfun import LensfunNames, write_database
from radiometry.geometry.camera import CameraModel, project

_SAMPLES = 33


def export_lensfun(camera: CameraModel, *, names: LensfunNames, widest_f_number: float) -> str:
    """Write a Lensfun database with the camera, the lens, its centre and its distortion.

    Parameters
    ----------
    camera : CameraModel
        Camera of one version.
    names : LensfunNames
        Names and sizes of camera and lens.
    widest_f_number : float
        Widest f-number of the lens, as in its name.

    Notes
    -----
    Model "poly5" leads from the corrected to the seen radius [1]_, both about the lens's centre::

        r_seen = r (1 + k1 r^2 + k2 r^4),  r = 1 at half the diagonal over sqrt(aspect^2 + 1)

    where the diagonal runs between the centres of corner pixels. The centre counts from the frame's middle in
    the same unit; liblensfun 0.3.4 reads it, though the schema of its database has none. Lensfun has neither
    k3, tangential terms nor two focal lengths: k1 and k2 are fitted over the frame, together with the focal
    length and principal point of the corrected picture, which are free. A comment states the largest error.

    References
    ----------
    .. [1] Lensfun manual, "Lens calibration data format" and "Corrections"
    """
    middle, unit_px = _find_frame(camera)
    centre = (np.array((camera.cx_px, camera.cy_px)) - middle) / unit_px
    (k1, k2), error_px = _fit_terms(camera)
    terms = f'model="poly5" focal="{names.focal_length_mm:.9g}" k1="{k1:.9g}" k2="{k2:.9g}"'
    return write_database(
        names,
        [
            f"            <!-- largest error {error_px:.2f} px -->",
            f"            <distortion {terms}/>",
        ],
        centre=(float(centre[0]), float(centre[1])),
        width_px=camera.width_px,
        height_px=camera.height_px,
        widest_f_number=widest_f_number,
    )


def _fit_terms(camera: CameraModel) -> tuple[tuple[float, float], float]:
    """Return k1 and k2, and the largest error over what the corrected picture shows of the frame [px]."""
    middle, unit_px = _find_frame(camera)
    centre = np.array((camera.cx_px, camera.cy_px))
    lattice = np.meshgrid(*(np.linspace(0.0, 2.0 * half, _SAMPLES) for half in middle))
    places = np.stack(lattice, axis=-1).reshape(-1, 2) - centre
    squared = np.sum(np.square(places / unit_px), axis=1, keepdims=True)

    def see(focal_px: float, shift_px: NDArray[np.float64]) -> NDArray[np.float64]:
        directions = np.column_stack(((places - shift_px) / focal_px, np.ones(len(places))))
        return project(camera, directions, np.zeros(3), np.zeros(3))[:, ::-1]

    seen = see(camera.fx_px, np.zeros(2))
    inside = np.all((seen >= 0.0) & (seen <= 2.0 * middle), axis=1)

    def miss(values: NDArray[np.float64]) -> NDArray[np.float64]:
        k1, k2, focal, *shift = values
        shown = centre + places * (1.0 + squared * (k1 + squared * k2))
        wanted = see(focal * camera.fx_px, unit_px * np.array(shift))
        return np.asarray((shown - wanted)[inside], np.float64)

    found = scipy.optimize.least_squares(lambda values: miss(values).ravel(), (0.0, 0.0, 1.0, 0.0, 0.0)).x
    error_px = float(np.linalg.norm(miss(found), axis=1).max())
    return (float(found[0]), float(found[1])), error_px


def _find_frame(camera: CameraModel) -> tuple[NDArray[np.float64], float]:
    """Return the middle (x, y) of the frame [px], and the radius that is 1 for Lensfun [px]."""
    size = np.array((camera.width_px, camera.height_px), np.float64)
    aspect = float(size.max() / size.min())
    return (size - 1.0) / 2.0, float(np.linalg.norm(size - 1.0)) / 2.0 / math.hypot(aspect, 1.0)
