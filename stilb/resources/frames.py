"""Frames: asked for by hash, sent from the disk, looked at."""

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Unpack, overload

from stilb.connection import Connection
from stilb.details import Polygon
from stilb.records import Frame, KnownFrame
from stilb.resources.campaigns import region
from stilb.side_by_side import OnProgress
from stilb.transport import address
from stilb.upload import FrameDetails, PathLike, Upload, send_all, send_each

_MOST_HASHES = 1000  # in one question


class Frames(Connection):
    """Frames and their upload."""

    def known_frames(self, campaign_id: str, hashes: Iterable[str]) -> list[KnownFrame]:
        """Those of the files, by SHA-256, that the campaign has already and that need not be sent."""
        asked, found = list(dict.fromkeys(hashes)), list[KnownFrame]()
        for start in range(0, len(asked), _MOST_HASHES):
            body = {"sha256": asked[start : start + _MOST_HASHES]}
            answer = self._post(address("campaigns", campaign_id, "frames", "known"), body)
            found += map(KnownFrame.of, answer["known"])
        return found

    def propose(self, frames: Sequence[Mapping[str, Any]], **about: str) -> dict[str, Any]:
        """Return the method that the frames of a card suit, and role and scene of each; nothing is stored.

        ``frames``: its name, and as known taken_s, exposure_time_s, f_number, iso, band, signal_share.
        ``about``: `campaign_id`, `camera_id`, `method` or `kind`.
        """
        return self._post(address("proposals"), {"frames": [*frames], **about})

    @overload  # a str is an iterable of str too: the first overload is the one that is meant
    def push(  # type: ignore[overload-overlap]
        self,
        campaign_id: str,
        path: PathLike,
        *,
        role: str,
        scene: str | None = None,
        on_progress: OnProgress | None = None,
        **details: Unpack[FrameDetails],
    ) -> Frame: ...
    @overload
    def push(
        self,
        campaign_id: str,
        path: Iterable[PathLike],
        *,
        role: str,
        scene: str | None = None,
        on_progress: OnProgress | None = None,
        **details: Unpack[FrameDetails],
    ) -> list[Frame]: ...
    def push(
        self,
        campaign_id: str,
        path: PathLike | Iterable[PathLike],
        *,
        role: str,
        scene: str | None = None,
        on_progress: OnProgress | None = None,
        **details: Unpack[FrameDetails],
    ) -> Frame | list[Frame]:
        """Send one file, or several that share role, scene and details, from the disk in flat memory."""
        one = isinstance(path, str | os.PathLike)
        paths = [path] if isinstance(path, str | os.PathLike) else list(path)
        uploads = [
            Upload(campaign_id=campaign_id, path=each, role=role, scene=scene, **details) for each in paths
        ]
        frames = self.push_all(uploads, on_progress=on_progress)
        return frames[0] if one else frames

    def push_all(
        self,
        items: Iterable[Upload],
        *,
        concurrency: int | None = None,
        on_progress: OnProgress | None = None,
    ) -> list[Frame]:
        """Send many files side by side; see ``Upload``. Safe to call again with the same files.

        ``concurrency`` files at once; by default two, and more of less than 1 MiB where the line is quick.
        """
        return send_all(self._transport, list(items), concurrency=concurrency, on_progress=on_progress)

    def push_each(
        self,
        items: Iterable[Upload],
        *,
        concurrency: int | None = None,
        on_progress: OnProgress | None = None,
    ) -> list[Frame | Exception]:
        """The same, but a file that is refused or cannot be read does not keep the others from going.

        Its error takes the place of its frame. What concerns all of them, such as a lost network, is raised.
        """
        return send_each(self._transport, list(items), concurrency=concurrency, on_progress=on_progress)

    def frame(self, frame_id: str) -> Frame:
        return Frame.of(self._get(address("frames", frame_id)))

    def frames(self, campaign_id: str) -> Iterator[Frame]:
        """A campaign's frames with their verdicts, oldest first."""
        return map(Frame.of, self._transport.items(address("campaigns", campaign_id, "frames")))

    def set_frame_roi(self, frame_id: str, polygon: Polygon | str) -> dict[str, Any]:
        """Set a region for one frame: corners [px], or ImageJ's macro call."""
        body = {"imagej": polygon} if isinstance(polygon, str) else region(polygon)
        return self._put(address("frames", frame_id, "roi"), body)
