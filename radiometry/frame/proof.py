"""What vouches for the pixels of a frame."""

from dataclasses import dataclass, field
from typing import Literal

from radiometry.frame import FrameHeader
from radiometry.frame.wholeness import Wholeness, describe_empty

Voucher = Literal["digest", "checksum", "end", "length", "libraw"]
"""What says that the samples are those that the camera wrote, the strongest first.

"digest" : the file's own, of all samples; "checksum" : of each compressed piece; "end" : each piece
ends where it says and is as long as its samples need; "length" : the file has a byte for each sample;
"libraw" : LibRaw's word
"""


@dataclass(frozen=True, kw_only=True)
class PieceRun:
    """Equal pieces (strips or tiles) that follow each other.

    ``consumed_bytes`` : of each, up to the end of its data; ``samples`` : that each gave
    """

    pieces: int
    stored_bytes: int
    consumed_bytes: int
    samples: int


@dataclass(frozen=True, kw_only=True)
class Proof:
    """What was seen of a frame's pixels when all of them were read.

    ``pieces`` : those of the first thousand runs, empty where LibRaw decoded the frame
    """

    vouched_by: Voucher
    wholeness: Wholeness
    pieces: tuple[PieceRun, ...] = field(default=())

    def describe_doubt(self, header: FrameHeader) -> str:
        """Return what is to be doubted, as a sentence without its end; "" where nothing is."""
        return describe_empty(self.wholeness.empty, height_px=header.height_px, width_px=header.width_px)
