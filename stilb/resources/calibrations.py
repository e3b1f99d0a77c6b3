"""Calibrations: fitted, published, revoked, handed out."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from stilb.export import OnExport, export
from stilb.problem import Problem, Unclear
from stilb.records import DEFAULT_METHOD, Calibration, Coefficient, Job, Moment, as_text, as_times
from stilb.resources import campaigns, equipment, frames
from stilb.transport import Call, PathLike, address, without_none

_ISSUED_WITHIN_S = 300.0  # the pages of the certificate are set before the answer


class Calibrations(campaigns.Campaigns, frames.Jobs):
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
        return map(Calibration.of, self._items(address("campaigns", campaign_id, "calibrations")))

    def history(
        self, camera_id: str, *, method: str | None = None, state: str | None = None
    ) -> Iterator[Calibration]:
        """A camera's calibrations, newest first."""
        query = {"method": method, "state": state}
        return map(Calibration.of, self._items(address("cameras", camera_id, "calibrations"), query))

    def validity(
        self, camera_id: str, *, method: str, known_at: Moment | None = None
    ) -> list[dict[str, Any]]:
        """Return published versions with their times in force as known at ``known_at``, newest first."""
        query = {"method": method, "known_at": as_text(known_at)}
        return list(self._get(address("cameras", camera_id, "validity"), query)["items"])

    def publish(
        self, calibration_id: str, *, valid_from: Moment, reason: str, valid_to: Moment | None = None
    ) -> Calibration:
        times = without_none({"valid_from": as_text(valid_from), "valid_to": as_text(valid_to)})
        path, body = address("calibrations", calibration_id, "publish"), {**times, "reason": reason}
        call = Call(method="POST", path=path, json=body, answer_within_s=_ISSUED_WITHIN_S)
        return Calibration.of(self._transport.json(call))

    def impact(self, calibration_id: str, *, at: Moment | None = None) -> dict[str, Any]:
        """Compare a version with what is in force at ``at`` (now): what publishing it would change."""
        return self._get(address("calibrations", calibration_id, "impact"), {"at": as_text(at)})

    def revoke(self, calibration_id: str, *, reason: str) -> dict[str, Any]:
        """Take a version out of force; the answer lists the measurements that rest on it."""
        return self._post(address("calibrations", calibration_id, "revoke"), {"reason": reason})

    def certificate(self, calibration_id: str, *, amendment: int = 0) -> dict[str, Any]:
        """Return what is handed out with a version, and all that is needed to compute it again.

        Of a published version it is the original as it was issued, or an amendment by its number; how the
        version stands since is in `calibration`.
        """
        query = {"amendment": amendment or None}
        return self._get(address("calibrations", calibration_id, "certificate.json"), query)

    def certificate_dcc(self, calibration_id: str, *, country: str, amendment: int = 0) -> str:
        """Return the certificate as DCC XML; ``country`` : of the laboratory, two letters of ISO 3166."""
        path = address("calibrations", calibration_id, "certificate.xml")
        return self._text(path, {"country": country, "amendment": amendment or None})

    def export(self, calibration_id: str, folder: PathLike, *, on_progress: OnExport | None = None) -> Path:
        """Put everything that a version rests on into a folder; see ``stilb.export``. Safe to call again."""
        return export(self._transport, calibration_id, Path(folder), on_progress)

    def save_form(self, calibration_id: str, path: PathLike, **query: str | float) -> Path:
        """Save a version in the form that another program reads; the file's name says which.

        They are the paths with ``/exports/`` of the service's OpenAPI document, such as `opencv.yaml`;
        ``query`` is what the form needs, such as ``f_number=2.8``.
        """
        path = Path(path)
        where = address("calibrations", calibration_id, "exports", path.name)
        return self._save(path, where, query)


class Coefficients(equipment.Equipment):
    """Coefficients by camera and time."""

    def coefficients(
        self,
        camera_id: str,
        *,
        method: str = DEFAULT_METHOD,
        name: str | None = None,
        iso: float | None = None,
        f_number: float | None = None,
        at: Moment | None = None,
        known_at: Moment | None = None,
    ) -> list[Coefficient]:
        """Return the coefficients in force at ``at`` (now), as they were known at ``known_at`` (now).

        With ``f_number``, what was calibrated at that f-number; where it was not, the general value with the
        uncertainty that it has there, flagged.
        Raises ``Problem`` with the code "no_calibration_in_force" where nothing is.
        """
        query = {"method": method, "name": name, "iso": iso, "f_number": f_number}
        times = {"at": as_text(at), "known_at": as_text(known_at)}
        rows = self._items(address("cameras", camera_id, "coefficients"), {**query, **times})
        return [Coefficient.of(row) for row in rows]

    def k(self, camera: str, **chosen: Any) -> Coefficient:  # noqa: ANN401  see `coefficients`
        """The luminance coefficient K [DN*m2/(cd*s)] of a camera, by its id or its serial.

        With ``f_number``, K at that f-number; see `coefficients`. ``iso`` may be left out where there is
        one K; else ``Unclear`` names the ISO values. Nothing in force: ``Problem`` with the code
        "no_calibration_in_force".
        """
        found = self.coefficients(self.find_camera(camera).id, name="luminance_k", **chosen)
        if len(found) > 1:
            isos = ", ".join(f"{one.iso:g}" for one in found if one.iso is not None)
            raise Unclear(f"K is in force for several ISO values: {isos}. Give one with iso.")
        return found[0]

    def series(
        self,
        *,
        camera_id: str | None = None,
        method: str | None = None,
        start: Moment | None = None,
        end: Moment | None = None,
    ) -> list[dict[str, Any]]:
        """The coefficients of every version, published for a time in [start, end), as flat rows.

        Every row has the same columns, None where a value is absent, times as aware datetimes: made to be
        handed to ``pandas.DataFrame``.
        """
        times = {"from": as_text(start), "to": as_text(end)}
        query = {"camera_id": camera_id, "method": method, **times}
        rows = list(self._items(address("series", "coefficients"), query, member="rows"))
        columns = dict.fromkeys(name for row in rows for name in row)
        return [as_times({name: row.get(name) for name in columns}) for row in rows]

    def fleet_verdict(self, method: str, camera_ids: Sequence[str], *, tolerance: float) -> dict[str, Any]:
        """Judge whether one set of coefficients serves several cameras of a model, and what sharing it costs.

        ``tolerance``: the largest accepted deviation, a share such as 0.04, or of geometry in pixels.
        """
        body = {"method": method, "camera_ids": list(camera_ids), "tolerance": tolerance}
        return self._post(address("fleet", "verdict"), body)
