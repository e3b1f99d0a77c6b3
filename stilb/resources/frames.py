"""Frames: asked for by hash, sent from the disk, looked at."""

import os
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Unpack, overload

from stilb import problem, transport, upload
from stilb.records import Frame, Job, KnownFrame, Polygon
from stilb.resources.campaigns import region

_MOST_HASHES = 1000  # in one question


class Frames(transport.Connection):
    """Frames and their upload."""

    def known_frames(self, campaign_id: str, hashes: Iterable[str]) -> list[KnownFrame]:
        """Those of the files, by SHA-256, that the campaign has already and that need not be sent."""
        asked, found = list(dict.fromkeys(hashes)), list[KnownFrame]()
        for start in range(0, len(asked), _MOST_HASHES):
            body = {"sha256": asked[start : start + _MOST_HASHES]}
            answer = self._post(transport.address("campaigns", campaign_id, "frames", "known"), body)
            found += map(KnownFrame.of, answer["known"])
        return found

    def propose(self, frames: Sequence[Mapping[str, Any]], **about: str) -> dict[str, Any]:
        """Return the method that the frames of a card suit, and role and scene of each; nothing is stored.

        ``frames``: its name, and as known taken_s, exposure_time_s, f_number, iso, band, signal_share.
        ``about``: `campaign_id`, `camera_id`, `method` or `kind`.
        """
        return self._post(transport.address("proposals"), {"frames": [*frames], **about})

    @overload  # a str is an iterable of str too: the first overload is the one that is meant
    def push(  # type: ignore[overload-overlap]
        self, campaign_id: str, path: transport.PathLike, **details: Unpack[upload.PushDetails]
    ) -> Frame: ...
    @overload
    def push(
        self, campaign_id: str, path: Iterable[transport.PathLike], **details: Unpack[upload.PushDetails]
    ) -> list[Frame]: ...
    def push(
        self,
        campaign_id: str,
        path: transport.PathLike | Iterable[transport.PathLike],
        *,
        on_progress: upload.OnProgress | None = None,
        **details: Any,
    ) -> Frame | list[Frame]:
        """Send one file, or several that share role, scene and details, from the disk in flat memory."""
        if isinstance(path, str | os.PathLike):
            return self.push(campaign_id, [path], on_progress=on_progress, **details)[0]
        uploads = (upload.Upload(campaign_id=campaign_id, path=each, **details) for each in path)
        return self.push_all(uploads, on_progress=on_progress)

    def push_all(
        self,
        items: Iterable[upload.Upload],
        *,
        concurrency: int | None = None,
        on_progress: upload.OnProgress | None = None,
    ) -> list[Frame]:
        """Send many files side by side; see ``Upload``. Safe to call again with the same files.

        ``concurrency`` files at once; by default two, and more of less than 1 MiB where the line is quick.
        The first failure stops what has not begun and is raised, with the file's name as its note.
        """
        return upload.send_side_by_side(
            self._transport, list(items), upload.send_file, at_once=concurrency, on_progress=on_progress
        )

    def push_each(
        self,
        items: Iterable[upload.Upload],
        *,
        concurrency: int | None = None,
        on_progress: upload.OnProgress | None = None,
    ) -> list[Frame | Exception]:
        """The same, but a file that is refused or cannot be read does not keep the others from going.

        Its error takes the place of its frame. What concerns all of them, such as a lost network, is raised.
        """
        return upload.send_side_by_side(
            self._transport, list(items), upload.try_file, at_once=concurrency, on_progress=on_progress
        )

    def frame(self, frame_id: str) -> Frame:
        return Frame.of(self._get(transport.address("frames", frame_id)))

    def frames(self, campaign_id: str) -> Iterator[Frame]:
        """A campaign's frames with their verdicts, oldest first."""
        return map(Frame.of, self._items(transport.address("campaigns", campaign_id, "frames")))

    def set_frame_roi(self, frame_id: str, polygon: Polygon | str) -> dict[str, Any]:
        """Set a region for one frame: corners [px], or ImageJ's macro call."""
        body = {"imagej": polygon} if isinstance(polygon, str) else region(polygon)
        return self._put(transport.address("frames", frame_id, "roi"), body)


_WAIT_S = 30  # one long poll; the service allows 60
_SHORTEST_POLL_S = 0.2  # should an answer come at once all the same


class Jobs(transport.Connection):
    """Jobs, and what comes of them."""

    def job(self, job_id: str) -> Job:
        return Job.of(self._get(transport.address("jobs", job_id)))

    def jobs(
        self, *, state: str | None = None, kind: str | None = None, subject: str | None = None
    ) -> Iterator[Job]:
        """The jobs of your organisation, newest first.

        ``subject``: the frame or campaign that they work on, or the version or measurement that they made.
        """
        query = {"state": state, "kind": kind, "subject": subject}
        return map(Job.of, self._items(transport.address("jobs"), query))

    def retry_job(self, job: Job | str) -> Job:
        """Try a job again that failed or was quarantined; the job as it waits then."""
        job_id = job if isinstance(job, str) else job.id
        return Job.of(self._post(f"{transport.address('jobs', job_id)}/retry", {}))

    def retry_jobs(self, state: str, **chosen: str | None) -> int:
        """Try all ``failed`` or ``quarantined`` jobs of a kind, code or campaign_id again; how many."""
        body = transport.without_none({"state": state, **chosen})
        return int(self._post(transport.address("jobs", "retry"), body)["retried"])

    def dismiss_jobs(self, state: str, *, dismissed: bool = True, **chosen: str | None) -> int:
        """Dismiss such jobs, or list them again; how many."""
        body = transport.without_none({"state": state, "dismissed": dismissed, **chosen})
        return int(self._post(transport.address("jobs", "dismiss"), body)["dismissed"])

    def wait(self, job: Job | str, *, timeout_s: float | None = None) -> Job:
        """Wait until a job has succeeded; ``JobFailed`` when it will not, ``TimeoutError`` when it lasts."""
        job_id = job if isinstance(job, str) else job.id
        end = None if timeout_s is None else time.monotonic() + timeout_s
        while True:
            asked_at = time.monotonic()
            left_s = _WAIT_S if end is None else max(0, min(_WAIT_S, int(end - asked_at)))
            call = transport.Call(
                method="GET",
                path=transport.address("jobs", job_id),
                headers={"Prefer": f"wait={left_s}"},
                answer_within_s=left_s + self._timeout_s,
            )
            found = Job.of(self._transport.json(call))
            if found.state == "succeeded":
                return found
            if found.state not in {"queued", "running"}:
                raise problem.JobFailed(found)
            if end is not None and time.monotonic() >= end:
                raise TimeoutError(f"job {job_id} is still {found.state} after {timeout_s:g} s")
            time.sleep(max(0.0, _SHORTEST_POLL_S - (time.monotonic() - asked_at)))


class Receipts(transport.Connection):
    """Manifests and receipts."""

    def send_manifest(
        self, campaign_id: str, files: Iterable[dict[str, Any]], *, others: Iterable[dict[str, Any]] = ()
    ) -> dict[str, Any]:
        """State what a card holds; the answer lists what is ``missing``, each with its reason.

        Of each file `name`, its path below the card's folder, `size_bytes` and `sha256`; ``others`` are not
        sent and have none: a receipt names them as not covered.
        """
        body = {"files": [*files], "others": [*others]}
        return self._post(transport.address("campaigns", campaign_id, "manifest"), body)

    def receipt(self, campaign_id: str, manifest_id: str | None = None) -> dict[str, Any]:
        """Return a manifest's signed receipt, by default the newest; ``Problem`` while files are missing."""
        return self._get(transport.address("campaigns", campaign_id, "receipt"), {"manifest_id": manifest_id})

    def signing_keys(self) -> list[dict[str, Any]]:
        """The service's public keys, newest first: keep them where receipts are verified."""
        return list(self._get(transport.address("signing-keys"))["items"])
