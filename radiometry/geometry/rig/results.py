"""Results of a rig's orientation: plain numbers, ready for JSON."""

from dataclasses import dataclass

from radiometry.findings import Raised
from radiometry.fitting.evidence import Quantity


@dataclass(frozen=True, kw_only=True)
class RelativePose:
    """Orientation of one camera against the reference: X_camera = R X_reference + t.

    Attributes
    ----------
    camera : str
        Serial number of the camera.
    rotation : tuple of float
        Rodrigues vector of R [rad].
    matrix : tuple of tuple of float
        R, (3, 3).
    translation_m : tuple of float
        t [m].
    covariance : tuple of tuple of float
        Covariance of rotation [rad] and translation [m], (6, 6), the cameras' own uncertainties included.
    orientation_covariance : tuple of tuple of float
        The same for the cameras exactly as calibrated.
    yaw, pitch, roll : Quantity
        Boresight angles: the camera's axes in the reference's frame are Ry(yaw) Rx(pitch) Rz(roll).
    boresight : Quantity
        Angle between the optical axes.
    x, y, z : Quantity
        Place of the camera's centre in the reference's frame, x right, y down, z forward.
    effective_dof : dict of str to float
        Effective degrees of freedom of each of the quantities above.
    triggers : int
        Number of triggers with a picture of this camera that were used.
    """

    camera: str
    rotation: tuple[float, ...]
    matrix: tuple[tuple[float, ...], ...]
    translation_m: tuple[float, ...]
    covariance: tuple[tuple[float, ...], ...]
    orientation_covariance: tuple[tuple[float, ...], ...]
    yaw: Quantity
    pitch: Quantity
    roll: Quantity
    boresight: Quantity
    x: Quantity
    y: Quantity
    z: Quantity
    effective_dof: dict[str, float]
    triggers: int


@dataclass(frozen=True, kw_only=True)
class RigPoint:
    """One picture of the set.

    Attributes
    ----------
    camera, frame, trigger : str
        Serial number of the camera, name of the frame, and trigger, "" if it has none.
    used : bool
        True if the orientation used it.
    left_out : str
        "" for one that was used, else the reason.
    rms_px : float or None
        Rms distance of its corners from the model [px].
    """

    camera: str
    frame: str
    trigger: str
    used: bool
    left_out: str
    rms_px: float | None = None


@dataclass(frozen=True, kw_only=True)
class RigFit:
    """Orientation of all cameras of a rig from one set of pictures.

    Attributes
    ----------
    reference : str
        Serial number of the reference camera.
    poses : tuple of RelativePose
        Orientation of each other camera.
    corner_scatter_rel : float
        Scatter of the corners about poses that are free in each trigger, over that in the cameras' own
        calibrations.
    scatter_deg, scatter_mm : float
        Scatter of the orientation from trigger to trigger beyond that of the corners.
    triggers, corners, degrees_of_freedom : int
        Number of triggers and of corners that were used, and degrees of freedom.
    points : tuple of RigPoint
        Every picture.
    flags : tuple of Raised
        Flags of the set.
    """

    reference: str
    poses: tuple[RelativePose, ...]
    corner_scatter_rel: float
    scatter_deg: float
    scatter_mm: float
    triggers: int
    corners: int
    degrees_of_freedom: int
    points: tuple[RigPoint, ...]
    flags: tuple[Raised, ...]
