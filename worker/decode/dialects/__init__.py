"""Dialects of the makers of multispectral cameras: a module each, whose name is its key in `CAMERAS`."""

from importlib import import_module
from typing import Final, Protocol, cast

from radiometry.frame.multispectral import CAMERAS, Multispectral
from worker.decode.packet import Packet, open_packet
from worker.decode.tiff import Directory


class Dialect(Protocol):
    """A module that reads the files of some cameras."""

    IDENTITIES: tuple[str, str]
    """Names under which the files state the capture and the flight."""

    def knows(self, packet: Packet) -> bool:
        """Return True if the file is of one of its cameras."""

    def read(self, packet: Packet) -> Multispectral:
        """Read the band."""


DIALECTS: Final = tuple(cast("Dialect", import_module(f"{__name__}.{name}")) for name in CAMERAS)
BY_SYSTEM: Final = dict(zip(CAMERAS, DIALECTS, strict=True))


def read_multispectral(main: Directory, *, bits: int) -> Multispectral | None:
    """The band, by the first dialect that knows the camera; None for any other file."""
    packet = open_packet(main, bits=bits)
    if packet is None:
        return None
    return next((dialect.read(packet) for dialect in DIALECTS if dialect.knows(packet)), None)
