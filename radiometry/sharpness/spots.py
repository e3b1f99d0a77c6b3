"""Signal of a spot along four arms from its middle."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from radiometry.frame.roi import Window
from radiometry.sharpness import codes
from radiometry.sharpness.sampling import Matrix, Plane

FEWEST_PLACES: Final = 8
STRIP_REL: Final = 1 / 32
"""Half of an arm's width as a fraction of the region's shorter side."""


@dataclass(frozen=True, kw_only=True)
class SpotArm:
    """Signal from the middle of a spot outwards.

    Attributes
    ----------
    direction : str
        "up", "down", "left" or "right".
    distance_px : tuple of float
        Distances from the region's middle [px].
    signal_dn, u_dn : tuple of float
        Mean over a strip above black, and its standard uncertainty from the scatter in the strip [DN].
    """

    direction: str
    distance_px: tuple[float, ...]
    signal_dn: tuple[float, ...]
    u_dn: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class SpotResponse:
    """Spot in one channel of one frame."""

    channel: str
    arms: tuple[SpotArm, ...]


def measure_spot(plane: Plane, *, window: Window) -> SpotResponse:
    """Read the signal along four arms from the middle of a region.

    Parameters
    ----------
    plane : Plane
        Samples of one channel.
    window : Window
        Region, whose middle is the spot's.

    Returns
    -------
    SpotResponse
        Signal of each arm.

    Raises
    ------
    InputRejected
        `spot_region_small` if an arm has fewer than 8 places.
    """
    half = max(plane.pitch_px, min(window.height, window.width) * STRIP_REL)
    middle = window.row0 + (window.height - 1) / 2.0, window.col0 + (window.width - 1) / 2.0
    rows = np.broadcast_to(plane.line_px[:, None], plane.values.shape) - middle[0]
    cols = plane.positions_px - middle[1]
    arms = []
    for direction, along, across in (
        ("up", -rows, cols),
        ("down", rows, cols),
        ("left", -cols, rows),
        ("right", cols, rows),
    ):
        mine = (np.abs(across) <= half) & (along >= 0.0)
        places, place = np.unique(along[mine], return_inverse=True)
        if len(places) < FEWEST_PLACES:
            raise codes.SPOT_REGION_SMALL.refuse(
                f"Channel {plane.channel} has {len(places)} places from the middle of the region {direction}."
            )
        count = np.bincount(place)
        mean = np.bincount(place, plane.values[mine]) / count
        squares = np.bincount(place, (plane.values[mine] - mean[place]) ** 2)
        u = np.sqrt(squares / np.maximum(count - 1, 1) / count)
        arms.append(SpotArm(direction=direction, **_state(distance_px=places, signal_dn=mean, u_dn=u)))
    return SpotResponse(channel=plane.channel, arms=tuple(arms))


def _state(**values: Matrix) -> dict[str, tuple[float, ...]]:
    return {name: tuple(float(each) for each in numbers) for name, numbers in values.items()}
