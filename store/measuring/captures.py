"""Which frames of a campaign are bands of one capture: looked up once, however many are asked for."""

from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.findings import InputRejected, shared
from store.tables import FrameRow

_SAID = FrameRow.header["multispectral"]


class Captures:
    """Captures of the campaigns of the frames that are asked for, as they are when first asked."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._frames: dict[str, dict[tuple[str, str], str]] = {}

    def find(self, frame: FrameRow, band: str) -> FrameRow:
        """The frame of a band in the capture, and campaign, of a frame that has been read.

        Raises InputRejected(capture_incomplete)
        """
        shown = (frame.header or {}).get("multispectral") or {}
        if shown.get("band") == band:
            return frame
        capture_id = shown.get("capture_id")
        found = self._of_campaign(frame.campaign_id).get((capture_id, band)) if capture_id else None
        if found is None:
            there = ", ".join(sorted(self.list_bands(frame)))
            raise InputRejected(
                shared.CAPTURE_INCOMPLETE,
                f"The campaign holds no frame of band {band} of the capture that {frame.filename} belongs "
                f"to, or it has not been read yet; there are {there or 'none'}. Upload the other files.",
            )
        return self._session.get_one(FrameRow, found)

    def list_bands(self, frame: FrameRow) -> dict[str, str]:
        """Return the ids of all frames of a frame's capture by band."""
        capture_id = ((frame.header or {}).get("multispectral") or {}).get("capture_id")
        frames = self._of_campaign(frame.campaign_id) if capture_id else {}
        return {band: frame_id for (capture, band), frame_id in frames.items() if capture == capture_id}

    def _of_campaign(self, campaign_id: str) -> dict[tuple[str, str], str]:
        """Ids by capture and band; of two frames of one band the older."""
        if campaign_id not in self._frames:
            rows = self._session.execute(
                select(_SAID["capture_id"].as_string(), _SAID["band"].as_string(), FrameRow.id)
                .where(FrameRow.campaign_id == campaign_id, FrameRow.exposure_time_s.is_not(None))
                .where(FrameRow.state != "refused", FrameRow.withdrawn_at.is_(None))
                .order_by(FrameRow.id.desc())
            )
            self._frames[campaign_id] = {(capture, band): frame_id for capture, band, frame_id in rows}
        return self._frames[campaign_id]
