"""Evidence that the pixels of a frame are complete."""

from dataclasses import dataclass, field
from typing import Literal

from radiometry.frame import FrameHeader
from radiometry.frame.wholeness import Wholeness, describe_empty

Voucher = Literal["digest", "checksum", "end", "length", "libraw"]
"""Check that shows that the samples are those that the camera wrote, the strongest first.

"digest" is the file's own digest of all samples, and "checksum" one of each compressed piece. "end": each
piece ends where it states and is as long as its samples need. "length": the file has a byte for each sample.
"libraw": LibRaw reported success.
"""


@dataclass(frozen=True, kw_only=True)
class PieceRun:
    """Consecutive pieces (strips or tiles) of equal size.

    Attributes
    ----------
    pieces : int
        Number of pieces.
    stored_bytes : int
        Stored bytes of each piece.
    consumed_bytes : int
        Bytes of each piece up to the end of its data.
    samples : int
        Samples decoded from each piece.
    """

    pieces: int
    stored_bytes: int
    consumed_bytes: int
    samples: int


@dataclass(frozen=True, kw_only=True)
class Proof:
    """Evidence collected while all pixels of a frame were read.

    Attributes
    ----------
    vouched_by : Voucher
        Strongest check that the pixels passed.
    wholeness : Wholeness
        Result of the search for empty parts.
    pieces : tuple of PieceRun
        First thousand runs of pieces; empty if LibRaw decoded the frame.
    highest_dn : int
        Largest sample [DN]; 0 for frames that were read before it was noted.
    """

    vouched_by: Voucher
    wholeness: Wholeness
    pieces: tuple[PieceRun, ...] = field(default=())
    highest_dn: int = 0

    def describe_doubt(self, header: FrameHeader) -> str:
        """Return the doubt about the pixels as a sentence without its full stop; "" if there is none.

        Parameters
        ----------
        header : FrameHeader
            Metadata of the frame.

        Returns
        -------
        str
            Description of the empty parts.
        """
        return describe_empty(self.wholeness.empty, height_px=header.height_px, width_px=header.width_px)
