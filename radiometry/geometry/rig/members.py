"""Rigs of calibrated cameras, from the versions of their geometry."""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from radiometry.fitting.evidence import Quantity
from radiometry.geometry.rig.adjustment import RigCamera
from radiometry.geometry.rig.orientation import orient_rig
from radiometry.geometry.rig.results import RigFit
from radiometry.geometry.rig.triggers import BoardPicture, pair_pictures
from radiometry.geometry.views import make_view
from radiometry.specification.rig import RigMember

COMPARED: Final = ("yaw", "pitch", "roll", "x", "y", "z")


def orient_members(members: Sequence[RigMember]) -> RigFit:
    """Find the orientation of a rig from one version of each camera.

    Parameters
    ----------
    members : sequence of RigMember
        Versions, the reference first.

    Raises
    ------
    InputRejected
        `rig_incomplete`.
    """
    pictures = [each for number, member in enumerate(members) for each in list_pictures(member, number)]
    return orient_rig([_read_camera(member) for member in members], pictures)


def count_shared(first: RigMember, second: RigMember) -> int:
    """Return how many triggers have a picture of both cameras.

    Parameters
    ----------
    first, second : RigMember
        Versions of two cameras.
    """
    return len(pair_pictures([*list_pictures(first, 0), *list_pictures(second, 1)])[0])


def list_pictures(member: RigMember, number: int) -> list[BoardPicture]:
    """Return the pictures that a version used.

    Parameters
    ----------
    member : RigMember
        Version of a camera.
    number : int
        Number of the camera in the rig.
    """
    used = {point.frame for point in member.fitted.points if point.used}
    return [
        BoardPicture(
            frame=row.frame,
            camera=number,
            scene=row.scene,
            header=row.header,
            target=row.features.target,
            view=make_view(row.features, member.params),
        )
        for row in member.rows
        if row.frame in used and row.features
    ]


def list_quantities(orientation: RigFit) -> dict[tuple[str, str], Quantity]:
    """Return the angles and the place of each camera.

    Parameters
    ----------
    orientation : RigFit
        Orientation of a rig.

    Returns
    -------
    dict
        Quantities by camera and name.
    """
    return {(pose.camera, name): getattr(pose, name) for pose in orientation.poses for name in COMPARED}


def _read_camera(member: RigMember) -> RigCamera:
    fit = member.fitted
    return RigCamera(
        serial=member.serial,
        model=fit.camera,
        covariance=np.array(fit.covariance),
        noise_px=fit.rms_px * math.sqrt(fit.corners / fit.degrees_of_freedom),
        dof=float(fit.degrees_of_freedom),
    )
