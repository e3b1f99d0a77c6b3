"""MicaSense cameras whose lens is a polynomial in x/W and y/H: RedEdge-P and Altum-PT."""

from radiometry.frame.multispectral import Multispectral
from worker.decode.dialects import micasense
from worker.decode.packet import Packet, read_polynomial

IDENTITIES = micasense.IDENTITIES
_MODELS = ("RedEdge-P", "Altum-PT")


def knows(packet: Packet) -> bool:
    """By the model, or by the lens of another one that states no radial polynomial."""
    flat = bool(packet.xmp.numbers("camera:VignettingPolynomial2D"))
    radial = bool(packet.xmp.numbers("camera:VignettingPolynomial"))
    return micasense.knows(packet) and (packet.model.startswith(_MODELS) or (flat and not radial))


def read(packet: Packet) -> Multispectral:
    lens, problem = read_polynomial(packet.xmp)
    return micasense.read_band(packet, (problem,), system="micasense_2d", vignetting_polynomial=lens)
