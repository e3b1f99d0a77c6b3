"""Dialects of the makers of multispectral cameras: a module each, whose name is its key in `CAMERAS`.

`knows` tells from the packet whether a file is of one of its cameras, `read` reads the band, and `IDENTITIES`
are the names under which the files state the capture and the flight.
"""

from importlib import import_module
from typing import Final

from radiometry.frame.multispectral import CAMERAS, Multispectral
from worker.decode.packet import open_packet
from worker.decode.tiff import Directory

DIALECTS: Final = tuple(import_module(f"{__name__}.{name}") for name in CAMERAS)
BY_SYSTEM: Final = dict(zip(CAMERAS, DIALECTS, strict=True))


def read_multispectral(main: Directory, *, bits: int) -> Multispectral | None:
    """The band, by the first dialect that knows the camera; None for any other file."""
    if (packet := open_packet(main, bits=bits)) is None:
        return None
    return next((dialect.read(packet) for dialect in DIALECTS if dialect.knows(packet)), None)
