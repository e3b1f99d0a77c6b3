"""The client: one method a thing that a field team or a dashboard does."""

import os
import time
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self, Unpack, overload

from stilb.export import OnExport, export
from stilb.problem import JobFailed
from stilb.records import (
    Calibration,
    Camera,
    CameraDetails,
    Campaign,
    CampaignDetails,
    Certificate,
    Coefficient,
    Frame,
    Job,
    Meter,
    Moment,
    Polygon,
    Reading,
    as_text,
)
from stilb.transport import Call, Transport
from stilb.upload import FrameDetails, OnProgress, PathLike, Upload, send_all

_WAIT_S = 30  # one long poll; the service allows 60
_SHORTEST_POLL_S = 0.2  # should an answer come at once all the same


class Client:
    """A connection to one calibration service, for one key. Use it as a context manager.

    ``timeout`` is how long one silence of the service may last [s]. What is safe to send twice is sent again
    after a lost connection or a passing refusal, up to ``retries`` times, first after about ``backoff_s``.
    """

    def __init__(
        self, url: str, key: str, *, timeout: float = 60.0, retries: int = 5, backoff_s: float = 0.25
    ) -> None:
        self._timeout_s = timeout
        self._transport = Transport(url, key, timeout_s=timeout, retries=retries, backoff_s=backoff_s)

    def __enter__(self) -> Self:
        self._transport.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._transport.__exit__(kind, error, trace)

    def close(self) -> None:
        self._transport.close()

    # Cameras and meters: the same make, model and serial again is the same one.

    def create_camera(self, make: str, model: str, serial: str, **details: Unpack[CameraDetails]) -> Camera:
        body = {"make": make, "model": model, "serial": serial, **details}
        return Camera.of(self._post("/v1/cameras", body))

    def camera(self, camera_id: str) -> Camera:
        return Camera.of(self._get(f"/v1/cameras/{camera_id}"))

    def cameras(self) -> Iterator[Camera]:
        return map(Camera.of, self._transport.items("/v1/cameras"))

    def create_meter(
        self, kind: str, make: str, model: str, serial: str, *, certificate: Certificate | None = None
    ) -> Meter:
        """``kind``: luminance, illuminance or sunshine."""
        body: dict[str, Any] = {"kind": kind, "make": make, "model": model, "serial": serial}
        if certificate is not None:
            body["certificate"] = certificate
        return Meter.of(self._post("/v1/meters", body))

    def meters(self) -> Iterator[Meter]:
        return map(Meter.of, self._transport.items("/v1/meters"))

    # A campaign, its region and its readings

    def create_campaign(
        self, camera_id: str, *, method: str = "luminance", **details: Unpack[CampaignDetails]
    ) -> Campaign:
        body: dict[str, Any] = {"camera_id": camera_id, "method": method, **details}
        if "started_at" in details:
            body["started_at"] = as_text(details["started_at"])
        return Campaign.of(self._post("/v1/campaigns", body))

    def campaign(self, campaign_id: str) -> Campaign:
        return Campaign.of(self._get(f"/v1/campaigns/{campaign_id}"))

    def campaigns(self) -> Iterator[Campaign]:
        return map(Campaign.of, self._transport.items("/v1/campaigns"))

    @overload
    def set_roi(self, campaign_id: str, *, polygon: Polygon) -> dict[str, Any]: ...
    @overload
    def set_roi(self, campaign_id: str, *, imagej: str) -> dict[str, Any]: ...
    def set_roi(
        self, campaign_id: str, *, polygon: Polygon | None = None, imagej: str | None = None
    ) -> dict[str, Any]:
        """Set the region of every frame without one of its own: corners [px], or ImageJ's macro call."""
        body = {"imagej": imagej} if polygon is None else _region(polygon)
        return self._transport.json(Call(method="PUT", path=f"/v1/campaigns/{campaign_id}/roi", json=body))

    def roi(self, campaign_id: str) -> dict[str, Any]:
        return self._get(f"/v1/campaigns/{campaign_id}/roi")

    def add_readings(
        self, campaign_id: str, readings: Reading | Sequence[Reading] | str
    ) -> list[dict[str, Any]]:
        """Add one reading, several, or a CSV text whose first line names the columns."""
        path = f"/v1/campaigns/{campaign_id}/readings"
        if isinstance(readings, str):
            headers = {"Content-Type": "text/csv; charset=utf-8"}
            call = Call(method="POST", path=path, text=readings, headers=headers)
        else:
            call = Call(method="POST", path=path, json=readings)
        answer = self._transport.json(call)
        return list(answer["items"]) if "items" in answer else [answer]

    def readings(self, campaign_id: str) -> Iterator[dict[str, Any]]:
        return self._transport.items(f"/v1/campaigns/{campaign_id}/readings")

    # Frames

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
        self, items: Iterable[Upload], *, concurrency: int = 2, on_progress: OnProgress | None = None
    ) -> list[Frame]:
        """Send many files side by side; see ``Upload``. Safe to call again with the same files."""
        return send_all(self._transport, list(items), concurrency=concurrency, on_progress=on_progress)

    def frame(self, frame_id: str) -> Frame:
        return Frame.of(self._get(f"/v1/frames/{frame_id}"))

    def frames(self, campaign_id: str) -> Iterator[Frame]:
        return map(Frame.of, self._transport.items(f"/v1/campaigns/{campaign_id}/frames"))

    def set_frame_roi(self, frame_id: str, polygon: Polygon) -> dict[str, Any]:
        path = f"/v1/frames/{frame_id}/roi"
        return self._transport.json(Call(method="PUT", path=path, json=_region(polygon)))

    # Jobs

    def job(self, job_id: str) -> Job:
        return Job.of(self._get(f"/v1/jobs/{job_id}"))

    def wait(self, job: Job | str, *, timeout_s: float | None = None) -> Job:
        """Wait until a job has succeeded; ``JobFailed`` when it will not, ``TimeoutError`` when it lasts."""
        job_id = job if isinstance(job, str) else job.id
        end = None if timeout_s is None else time.monotonic() + timeout_s
        while True:
            asked_at = time.monotonic()
            left_s = _WAIT_S if end is None else max(0, min(_WAIT_S, int(end - asked_at)))
            call = Call(
                method="GET",
                path=f"/v1/jobs/{job_id}",
                headers={"Prefer": f"wait={left_s}"},
                answer_within_s=left_s + self._timeout_s,
            )
            found = Job.of(self._transport.json(call))
            if found.state == "succeeded":
                return found
            if found.state not in {"queued", "running"}:
                raise JobFailed(found)
            if end is not None and time.monotonic() >= end:
                raise TimeoutError(f"job {job_id} is still {found.state} after {timeout_s} s")
            time.sleep(max(0.0, _SHORTEST_POLL_S - (time.monotonic() - asked_at)))

    # Calibrations

    def calibrate(self, campaign_id: str, **params: object) -> Calibration:
        """Fit a campaign with the method's parameters and wait for the draft."""
        job = Job.of(self._post(f"/v1/campaigns/{campaign_id}/calibrations", params))
        done = self.wait(job)
        return self.calibration(str((done.result or {})["calibration_id"]))

    def calibration(self, calibration_id: str) -> Calibration:
        return Calibration.of(self._get(f"/v1/calibrations/{calibration_id}"))

    def calibrations(self, campaign_id: str) -> Iterator[Calibration]:
        return map(Calibration.of, self._transport.items(f"/v1/campaigns/{campaign_id}/calibrations"))

    def publish(
        self, calibration_id: str, *, valid_from: Moment, reason: str, valid_to: Moment | None = None
    ) -> Calibration:
        body = {"valid_from": as_text(valid_from), "reason": reason}
        if valid_to is not None:
            body["valid_to"] = as_text(valid_to)
        return Calibration.of(self._post(f"/v1/calibrations/{calibration_id}/publish", body))

    def revoke(self, calibration_id: str, *, reason: str) -> dict[str, Any]:
        """Take a version out of force; the answer lists the measurements that rest on it."""
        return self._post(f"/v1/calibrations/{calibration_id}/revoke", {"reason": reason})

    def certificate(self, calibration_id: str) -> dict[str, Any]:
        """What is handed out with a version, and all that is needed to compute it anew."""
        return self._get(f"/v1/calibrations/{calibration_id}/certificate.json")

    def export(self, calibration_id: str, folder: PathLike, *, on_progress: OnExport | None = None) -> Path:
        """Put everything that a version rests on into a folder; see ``stilb.export``. Safe to call again."""
        return export(self._transport, calibration_id, Path(folder), on_progress)

    def points_csv(self, calibration_id: str) -> str:
        return self._text(f"/v1/calibrations/{calibration_id}/points.csv")

    def plot_svg(self, calibration_id: str) -> str:
        return self._text(f"/v1/calibrations/{calibration_id}/plot.svg")

    # What a dashboard reads

    def history(
        self, camera_id: str, *, method: str | None = None, state: str | None = None
    ) -> Iterator[Calibration]:
        """A camera's calibrations, newest first."""
        query = {"method": method, "state": state}
        return map(Calibration.of, self._transport.items(f"/v1/cameras/{camera_id}/calibrations", query))

    def coefficients(
        self,
        camera_id: str,
        *,
        method: str = "luminance",
        iso: float | None = None,
        at: Moment | None = None,
        known_at: Moment | None = None,
    ) -> list[Coefficient]:
        """What is in force at ``at`` (now), as it was known at ``known_at`` (now).

        Raises ``Problem`` with the code "no_calibration_in_force" where nothing is.
        """
        query = {"method": method, "iso": iso, "at": _text_of(at), "known_at": _text_of(known_at)}
        rows = self._transport.items(f"/v1/cameras/{camera_id}/coefficients", query)
        return [Coefficient.of(row) for row in rows]

    def series(
        self,
        *,
        camera_id: str | None = None,
        method: str | None = None,
        start: Moment | None = None,
        end: Moment | None = None,
    ) -> list[dict[str, Any]]:
        """The coefficients of every version as flat rows, in one answer."""
        times = {"from": _text_of(start), "to": _text_of(end)}
        query = {"camera_id": camera_id, "method": method, **times}
        call = Call(method="GET", path="/v1/series/coefficients", query=query)
        return list(self._transport.json(call)["rows"])

    def _get(self, path: str) -> dict[str, Any]:
        return self._transport.json(Call(method="GET", path=path))

    def _post(self, path: str, body: object) -> dict[str, Any]:
        return self._transport.json(Call(method="POST", path=path, json=body))

    def _text(self, path: str) -> str:
        return self._transport.send(Call(method="GET", path=path)).text


def _region(polygon: Polygon) -> dict[str, Any]:
    return {"polygon": [[x, y] for x, y in polygon]}


def _text_of(moment: Moment | None) -> str | None:
    return None if moment is None else as_text(moment)
