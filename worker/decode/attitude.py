"""How the camera stood, its gimbal, its aircraft or its light sensor, as XMP says it."""

from typing import Final

from radiometry.frame import StatedAngle
from worker.decode.xmp import Xmp

_AXES: Final = ("Yaw", "Pitch", "Roll")
# A Sequoia's own, a MicaSense camera's of its light sensor (once in degrees, once in radians), a DJI's.
_NAMES: Final = (
    *(f"camera:{axis}" for axis in _AXES),
    *(f"camera:Irradiance{axis}" for axis in _AXES),
    *(f"dls:{axis}" for axis in _AXES),
    *(f"drone-dji:{part}{axis}Degree" for part in ("Gimbal", "Flight") for axis in _AXES),
)
_WHOLE_TURN: Final = 360.0


def read_attitude(xmp: Xmp) -> tuple[StatedAngle, ...]:
    """The angles that the file states, under its own names; what is none is left out."""
    found = ((name, xmp.number(name)) for name in _NAMES)
    return tuple(
        StatedAngle(name=name, value=value)
        for name, value in found
        if value is not None and abs(value) <= _WHOLE_TURN
    )
