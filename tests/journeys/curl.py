"""The door of HTTP with the curl program."""

import json
import subprocess
from collections.abc import Sequence
from pathlib import Path
from time import sleep
from typing import Any

from tests.journeys.door import Certificate, Door
from tests.journeys.plan import Corners, Figure, File, Plan, pick

_FINAL = {"succeeded", "failed", "quarantined"}


class Curl(Door):
    """docs/http.md, and the service's own `/docs`."""

    def __init__(self, url: str, key: str, folder: Path):
        super().__init__(url, key, folder)
        self._ids: dict[str, str] = {}
        self._meters: list[str] = []
        self._panel: str | None = None
        self._frames: dict[Path, str] = {}

    def register(self, plan: Plan) -> None:
        self._ids[plan.camera["serial"]] = self._post("cameras", plan.camera)["id"]
        self._meters = [self._post("meters", meter)["id"] for meter in plan.meters]
        self._panel = self._post("panels", plan.panel)["id"] if plan.panel else None

    def begin(self, plan: Plan) -> None:
        shown = {"panel_id": self._panel} if self._panel else {}
        camera_id, said = self._ids[plan.camera["serial"]], {"method": plan.method, **plan.details}
        campaign = self._post(
            "campaigns", {"camera_id": camera_id, "project_number": plan.number, **said, **shown}
        )
        self._ids[plan.number] = campaign["id"]

    def send(self, plan: Plan) -> None:
        jobs = []
        for file in plan.files:
            said = {"role": file.role, **file.exposure}
            said |= {"scene": file.scene} if file.scene else {}
            query = [word for name, value in said.items() for word in ("--url-query", f"{name}={value}")]
            path = f"campaigns/{self._ids[plan.number]}/frames"
            frame = self._read(path, "-F", f'file=@"{file.path}"', *query)
            self._frames[file.path] = frame["id"]
            jobs.append(frame["job_id"])
        for job in jobs:
            self._wait(job)

    def set_region(self, plan: Plan) -> None:
        body: dict[str, Any] = {"polygon": plan.region}
        if plan.regions is not None:
            body = {"regions": [{"name": name, "polygon": each} for name, each in plan.regions.items()]}
        self._get(f"campaigns/{self._ids[plan.number]}/roi", "-X", "PUT", *_json(body))

    def type_readings(self, plan: Plan) -> None:
        table = self.folder / "readings.csv"
        table.write_text(plan.write_spreadsheet())
        meters = [word for meter in self._meters for word in ("--url-query", f"meter_id={meter}")]
        sent = ["-H", "Content-Type: text/csv", "--data-binary", f"@{table}"]
        self._get(f"campaigns/{self._ids[plan.number]}/readings", *sent, *meters)

    def fit(self, plan: Plan) -> str:
        while self._read(f"campaigns/{self._ids[plan.number]}")["frames"]["being_read"]:
            sleep(0.5)
        job = self._post(f"campaigns/{self._ids[plan.number]}/calibrations", plan.params)
        return self._wait(job["id"])["result"]["calibration_id"]

    def publish(self, version: str, *, valid_from: str, valid_to: str | None = None, reason: str) -> None:
        until = {"valid_to": f"{valid_to}T00:00:00Z"} if valid_to else {}
        said = {"valid_from": f"{valid_from}T00:00:00Z", **until, "reason": reason}
        self._post(f"calibrations/{version}/publish", said)

    def look_up(self, plan: Plan, name: str, *, at: str | None = None, **where: float | str) -> Figure:
        moment = f"&at={at}T12:00:00Z" if at else ""
        camera_id = self._ids[plan.camera["serial"]]
        found = self._read(f"cameras/{camera_id}/coefficients?method={plan.method}{moment}")
        return pick(found["items"], name, where)

    def measure(self, plan: Plan, file: File, region: Corners) -> Figure:  # noqa: ARG002
        job = self._post("measurements", {"frame_id": self._frames[file.path], "roi": {"polygon": region}})
        done = self._wait(job["id"])
        mean = self._read(f"measurements/{done['result']['measurement_id']}")["mean"]
        return Figure(mean["value"], mean["standard_uncertainty"])

    def judge_fleet(self, method: str, serials: Sequence[str], *, tolerance: float) -> dict[str, str]:
        ids = [self._ids[serial] for serial in serials]
        found = self._post("fleet/verdict", {"method": method, "camera_ids": ids, "tolerance": tolerance})
        return {row["name"]: row["verdict"] for row in found["parameters"]}

    def find_motion_px(self, plan: Plan, file: File, **flight: float) -> float:  # noqa: ARG002
        time_s = self._read(f"frames/{self._frames[file.path]}")["exposure_time_s"]
        return self._post("tools/motion", {"exposure_time_s": time_s, **flight})["forward_blur_px"]

    def take_certificate(self, version: str) -> Certificate:
        path = self.folder / f"{version}.pdf"
        self._get(f"calibrations/{version}/certificate.pdf", "-o", str(path))
        place = f"{self.url}/v1/calibrations/{version}/certificate.json"
        return Certificate(pdf=path.read_bytes(), place=place, data=self.url)

    def _wait(self, job_id: str) -> dict[str, Any]:
        while (job := self._read(f"jobs/{job_id}", "-H", "Prefer: wait=60"))["state"] not in _FINAL:
            pass
        return job

    def _post(self, path: str, body: Any) -> Any:
        return self._read(path, *_json(body))

    def _read(self, path: str, *words: str) -> Any:
        return json.loads(self._get(path, *words))

    def _get(self, path: str, *words: str) -> str:
        done = subprocess.run(
            [
                *("curl", "-sS", "--fail-with-body", "-H", f"Authorization: Bearer {self.key}"),
                *(*words, f"{self.url}/v1/{path}"),
            ],
            check=False,
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, f"{path}: {done.stdout}\n{done.stderr}"
        return done.stdout


def _json(body: Any) -> list[str]:
    return ["-H", "Content-Type: application/json", "-d", json.dumps(body)]
