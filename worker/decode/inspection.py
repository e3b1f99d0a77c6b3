"""The one pass over a whole frame: its preview, and what vouches for its pixels."""

from typing import Final

from radiometry.frame.proof import Proof, WholenessCheck
from worker.decode.opened import OpenedFile
from worker.decode.preview import PreviewMaker

# In a picture to look at, black is a colour like others; it proves itself whole otherwise.
_PICTURES: Final = frozenset({"jpeg", "png", "table"})


def inspect(opened: OpenedFile, longest_side_px: int) -> tuple[bytes, Proof]:
    """Read every row of a frame once: its preview as a PNG, and its proof.

    Raises InputRejected for pixels that do not prove themselves whole
    """
    header = opened.header
    preview = PreviewMaker(header, longest_side_px)
    check = WholenessCheck(
        height_px=header.height_px,
        width_px=header.width_px,
        channels=3 if header.cfa == "rgb" else 1,
        black_dn=min(header.black_level_dn),
        lowest_dn=opened.lowest_dn,
        doubts_black=header.container not in _PICTURES,
        rendered=header.rendered,
    )
    highest_dn = 0
    for row0, samples in opened.bands():
        check.add(row0, samples)
        highest_dn = max(highest_dn, int(samples.max()))
        preview.add(row0, samples)
    vouched_by, pieces = opened.vouch()
    proof = Proof(vouched_by=vouched_by, pieces=pieces, wholeness=check.conclude(), highest_dn=highest_dn)
    return preview.finish(), proof
