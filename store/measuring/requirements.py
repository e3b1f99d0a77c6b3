"""Requirements of frames that are to be measured."""

from collections.abc import Sequence

from radiometry.findings import InputRejected, shared
from radiometry.frame.proof import Proof
from radiometry.methods import get_method
from store.codec import decode, decode_header
from store.tables import FrameRow

# what frames must have in common to be averaged, beside their exposure
_FORMAT = ("width_px", "height_px", "cfa", "white_level_dn", "rendered")


def require_read(frame: FrameRow, method: str) -> None:
    """Refuse a frame that was refused, has not been read, or lacks the exposure that its method needs."""
    if frame.state == "refused":
        raise InputRejected(
            shared.FRAME_NOT_READ, f"Frame {frame.filename} was refused: {frame.refusal_detail}"
        )
    if frame.header is None:
        raise InputRejected(
            shared.FRAME_NOT_READ,
            f"Frame {frame.filename} has not been read yet: wait for its job and ask again.",
        )
    application = get_method(method).application
    if frame.exposure is None and (application is None or application.needs_exposure):
        raise InputRejected(
            shared.EXPOSURE_MISSING,
            f"Frame {frame.filename} states no exposure: type its exposure_time_s, f_number and iso in.",
        )


def read_proof(frame: FrameRow) -> Proof | None:
    """Return the proof of a frame's pixels; None for one that was never read as a whole."""
    return decode(Proof, frame.proof) if frame.proof else None


def require_whole(frame: FrameRow, proof: Proof | None, allowed: Sequence[str]) -> None:
    """Refuse a frame with an empty part, unless somebody has asked for it by the flag's name."""
    if proof is None or not proof.wholeness.empty or shared.IMAGE_PART_EMPTY in allowed:
        return
    raise InputRejected(
        shared.IMAGE_PART_EMPTY,
        f"Frame {frame.filename}: {proof.describe_doubt(decode_header(frame.header or {}))}. Copy the file "
        f"from the card again. To measure it as it is, ask with allow=[{shared.IMAGE_PART_EMPTY}]: "
        "the measurement then carries that flag.",
    )


def require_repeat(repeat: FrameRow, frame: FrameRow) -> None:
    """Refuse to average two frames that are not repeats of one scene, and name what differs."""
    header, other = frame.header or {}, repeat.header or {}
    compared = {
        "campaign": (frame.campaign_id, repeat.campaign_id),
        "scene": (frame.scene, repeat.scene),
        "exposure": (frame.exposure, repeat.exposure),
        **{name: (header.get(name), other.get(name)) for name in _FORMAT},
    }
    differing = [name.replace("_", " ") for name, (here, there) in compared.items() if here != there]
    if frame.sha256 == repeat.sha256:
        differing = ["nothing: they are one image"]
    if differing:
        raise shared.FRAMES_DIFFER.refuse(
            f"{repeat.filename} cannot be averaged with {frame.filename}; different: {', '.join(differing)}."
        )
