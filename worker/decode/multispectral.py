"""The band of a multispectral camera's file, in whichever dialect its maker writes.

Nothing here can make a file unreadable: what is absent or nonsense reads as nothing, and the band says
what it lacks.
"""

from radiometry.frame.multispectral import Multispectral
from worker.decode.dialects import DIALECTS
from worker.decode.packet import open_packet
from worker.decode.tiff import Directory


def read_multispectral(main: Directory, *, bits: int) -> Multispectral | None:
    """The band, by the first dialect that knows the camera; None for any other file."""
    packet = open_packet(main, bits=bits)
    if packet is None:
        return None
    return next((dialect.read(packet) for dialect in DIALECTS if dialect.knows(packet)), None)
