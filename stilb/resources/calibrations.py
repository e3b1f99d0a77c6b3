"""Calibrations: fitted, published, revoked, handed out."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from stilb.details import Moment, as_text
from stilb.export import OnExport, export
from stilb.problem import Problem
from stilb.records import Calibration, Job
from stilb.resources.campaigns import Campaigns
from stilb.resources.jobs import Jobs
from stilb.transport import Call, address
from stilb.upload import PathLike

_ISSUED_WITHIN_S = 300.0  # the pages of the certificate are set before the answer


class Calibrations(Campaigns, Jobs):
    """Versions of a camera's coefficients."""

    def start_calibration(self, campaign_id: str, **params: object) -> Job:
        """Have a campaign fitted with the method's parameters; the job's result names the draft."""
        return Job.of(self._post(address("campaigns", campaign_id, "calibrations"), params))

    def calibrate(
        self, campaign_id: str, *, on_progress: Callable[[int, int], None] = lambda *_: None, **params: object
    ) -> Calibration:
        """The same once all frames that have arrived are read, and wait for the draft.

        ``on_progress`` as with ``wait_for``. After an upgrade the service may read all frames again.
        """
        job: Job | None = None
        while job is None:
            self.wait_for(campaign_id, on_progress=on_progress)
            try:
                job = self.start_calibration(campaign_id, **params)
            except Problem as found:
                if found.code != "campaign_incomplete" or not found.retryable:
                    raise
        done = self.wait(job)
        return self.calibration(str((done.result or {})["calibration_id"]))

    def calibration(self, calibration_id: str) -> Calibration:
        return Calibration.of(self._get(address("calibrations", calibration_id)))

    def calibrations(self, campaign_id: str) -> Iterator[Calibration]:
        return map(Calibration.of, self._transport.items(address("campaigns", campaign_id, "calibrations")))

    def history(
        self, camera_id: str, *, method: str | None = None, state: str | None = None
    ) -> Iterator[Calibration]:
        """A camera's calibrations, newest first."""
        query = {"method": method, "state": state}
        return map(
            Calibration.of, self._transport.items(address("cameras", camera_id, "calibrations"), query)
        )

    def validity(
        self, camera_id: str, *, method: str, known_at: Moment | None = None
    ) -> list[dict[str, Any]]:
        """Return a camera's published versions with the times for which they were in force, newest first.

        As known at ``known_at`` (now).
        """
        query = {"method": method} | ({} if known_at is None else {"known_at": as_text(known_at)})
        found = self._get(address("cameras", camera_id, "validity"), query)
        return list(found["items"])

    def publish(
        self, calibration_id: str, *, valid_from: Moment, reason: str, valid_to: Moment | None = None
    ) -> Calibration:
        body = {"valid_from": as_text(valid_from), "reason": reason}
        if valid_to is not None:
            body["valid_to"] = as_text(valid_to)
        call = Call(
            method="POST",
            path=address("calibrations", calibration_id, "publish"),
            json=body,
            answer_within_s=_ISSUED_WITHIN_S,
        )
        return Calibration.of(self._transport.json(call))

    def impact(self, calibration_id: str, *, at: Moment | None = None) -> dict[str, Any]:
        """Compare a version with what is in force at ``at`` (now): what publishing it would change."""
        query = {} if at is None else {"at": as_text(at)}
        return self._get(address("calibrations", calibration_id, "impact"), query)

    def revoke(self, calibration_id: str, *, reason: str) -> dict[str, Any]:
        """Take a version out of force; the answer lists the measurements that rest on it."""
        return self._post(address("calibrations", calibration_id, "revoke"), {"reason": reason})

    def certificate(self, calibration_id: str, *, amendment: int = 0) -> dict[str, Any]:
        """Return what is handed out with a version, and all that is needed to compute it again.

        Of a published version it is the original as it was issued, or an amendment by its number; how the
        version stands since is in `calibration`.
        """
        query = {"amendment": amendment} if amendment else {}
        return self._get(address("calibrations", calibration_id, "certificate.json"), query)

    def certificate_dcc(self, calibration_id: str, *, country: str, amendment: int = 0) -> str:
        """Return the certificate as DCC XML; ``country`` : of the laboratory, two letters of ISO 3166."""
        path = address("calibrations", calibration_id, "certificate.xml")
        query = {"country": country} | ({"amendment": str(amendment)} if amendment else {})
        return self._transport.send(Call(method="GET", path=path, query=query)).text

    def export(self, calibration_id: str, folder: PathLike, *, on_progress: OnExport | None = None) -> Path:
        """Put everything that a version rests on into a folder; see ``stilb.export``. Safe to call again."""
        return export(self._transport, calibration_id, Path(folder), on_progress)

    def save_form(self, calibration_id: str, path: PathLike, **query: str | float) -> Path:
        """Save a version in the form that another program reads; the file's name says which.

        Of vignetting `lensfun.xml`, `correction.tif`, `residuals.tif`; of geometry `opencv.yaml`,
        `cameras.json`, `lensfun-distortion.xml`, `camera.json`.

        ``query`` is what the form needs, such as ``f_number=2.8``.
        """
        path = Path(path)
        where = address("calibrations", calibration_id, "exports", path.name)
        self._transport.download(Call(method="GET", path=where, query=query), path)
        return path

    def points_csv(self, calibration_id: str) -> str:
        return self._text(address("calibrations", calibration_id, "points.csv"))

    def plot_svg(self, calibration_id: str) -> str:
        return self._text(address("calibrations", calibration_id, "plot.svg"))
