"""A reflectance panel beside a card with its code."""

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from radiometry.frame.roi import Window
from simulation.camera import Camera
from simulation.parts import Plane
from simulation.targets import Picture

_CARD_SIDES = 1.4  # white around the code
_SUBPIXEL_BITS = 4

Corners = NDArray[np.float32]


@dataclass(frozen=True, kw_only=True)
class Card:
    """A MicaSense panel with its QR code on the ground.

    Attributes
    ----------
    text : str
        Text of the code: the panel's serial number.
    pose : array
        Affine map (2, 3) from sides of the code, about its centre, to pixels (x, y).
    way : tuple of int
        Direction from the code to the panel, in the code's own axes.
    distance, side : float
        Distance between the centres of code and panel, and side of the panel, in sides of the code.
    ground, ink, panel, paper : float
        Tones; shares of the lamp's luminance where a camera photographs the card.
    """

    text: str
    pose: Plane = field(default_factory=lambda: np.array([[100.0, 0.0, 320.0], [0.0, 100.0, 240.0]]))
    way: tuple[int, int] = (1, 0)
    distance: float = 1.68
    side: float = 1.30
    ground: float = 0.12
    ink: float = 0.10
    panel: float = 0.50
    paper: float = 0.60

    @property
    def panel_corners(self) -> Corners:
        """Corners (x, y) of the panel [px]."""
        return self._place(self.distance * np.array(self.way), self.side)

    def _place(self, centre: Plane | tuple[float, float], side: float) -> Corners:
        square = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * side / 2.0 + centre
        return np.asarray(square @ self.pose[:, :2].T + self.pose[:, 2], np.float32)

    def paint(self, picture: Plane) -> None:
        """Paint card, code and panel over a picture, (row, col)."""
        fill(picture, self._place((0.0, 0.0), _CARD_SIDES), self.paper)
        modules = np.asarray(cv2.QRCodeEncoder.create().encode(self.text))
        modules = modules[2:-2, 2:-2] if modules[1].min() == 255 else modules  # without the rim
        count = modules.shape[0]
        for row, col in np.argwhere(modules < 128):
            centre = ((col + 0.5) / count - 0.5, (row + 0.5) / count - 0.5)
            fill(picture, self._place(centre, 1.0 / count), self.ink)
        fill(picture, self.panel_corners, self.panel)

    def draw(self, camera: Camera, window: Window) -> Plane:
        """Return the shares of the window's pixels."""
        picture = np.full((camera.sensor.height_px, camera.sensor.width_px), self.ground)
        self.paint(picture)
        return Picture(picture).draw(camera, window)


def fill(picture: Plane, corners: Corners, tone: float) -> None:
    """Fill a convex polygon to a sixteenth of a pixel; a corner (x, y) counts from the picture's own."""
    places = np.round((corners - 0.5) * (1 << _SUBPIXEL_BITS)).astype(np.int32)
    cv2.fillConvexPoly(picture, places, tone, shift=_SUBPIXEL_BITS)
