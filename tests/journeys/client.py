"""The door of `stilb.Client`."""

from collections.abc import Sequence
from pathlib import Path

import stilb
from tests.journeys.door import Certificate, Door
from tests.journeys.plan import Corners, Figure, File, Plan, pick


class Client(Door):
    """docs/client.md, and `help(stilb.Client)`."""

    def __init__(self, url: str, key: str, folder: Path):
        super().__init__(url, key, folder)
        self.client = stilb.Client(url, key)
        self._meters: list[str] = []
        self._panel: str | None = None
        self._frames: dict[Path, str] = {}

    def __exit__(self, *_):
        self.client.close()

    def register(self, plan: Plan) -> None:
        self.client.create_camera(**plan.camera)
        self._meters = [self.client.create_meter(**meter).id for meter in plan.meters]
        self._panel = self.client.create_panel(**plan.panel).id if plan.panel else None

    def begin(self, plan: Plan) -> None:
        shown = {"panel_id": self._panel} if self._panel else {}
        camera = self.client.find_camera(plan.camera["serial"])
        self.client.create_campaign(
            camera.id, method=plan.method, project_number=plan.number, **shown, **plan.details
        )

    def send(self, plan: Plan) -> None:
        campaign = self.client.find_campaign(plan.number)
        frames = self.client.push_all(
            [
                stilb.Upload(
                    campaign_id=campaign.id, path=file.path, role=file.role, scene=file.scene, **file.exposure
                )
                for file in plan.files
            ]
        )
        self._frames |= {file.path: frame.id for file, frame in zip(plan.files, frames, strict=True)}
        self.client.wait_for(campaign.id)

    def set_region(self, plan: Plan) -> None:
        campaign = self.client.find_campaign(plan.number)
        if plan.regions:
            self.client.set_roi(campaign.id, regions=plan.regions)
        else:
            self.client.set_roi(campaign.id, polygon=plan.region)

    def type_readings(self, plan: Plan) -> None:
        campaign = self.client.find_campaign(plan.number)
        self.client.add_readings(campaign.id, plan.readings, meter_ids=self._meters)

    def fit(self, plan: Plan) -> str:
        return self.client.calibrate(self.client.find_campaign(plan.number).id, **plan.params).id

    def publish(self, version: str, *, valid_from: str, valid_to: str | None = None, reason: str) -> None:
        until = f"{valid_to}T00:00:00Z" if valid_to else None
        self.client.publish(version, valid_from=f"{valid_from}T00:00:00Z", valid_to=until, reason=reason)

    def look_up(self, plan: Plan, name: str, *, at: str | None = None, **where: float | str) -> Figure:
        camera = self.client.find_camera(plan.camera["serial"])
        moment = f"{at}T12:00:00Z" if at else None
        rows = self.client.coefficients(camera.id, method=plan.method, at=moment)
        return pick((row.raw for row in rows), name, where)

    def measure(self, plan: Plan, file: File, region: Corners) -> Figure:  # noqa: ARG002
        measured = self.client.measure(self._frames[file.path], polygon=region)
        return Figure(measured.mean.value, measured.mean.standard_uncertainty)

    def judge_fleet(self, method: str, serials: Sequence[str], *, tolerance: float) -> dict[str, str]:
        ids = [self.client.find_camera(serial).id for serial in serials]
        found = self.client.fleet_verdict(method, ids, tolerance=tolerance)
        return {row["name"]: row["verdict"] for row in found["parameters"]}

    def find_motion_px(self, plan: Plan, file: File, **flight: float) -> float:
        campaign = self.client.find_campaign(plan.number)
        found = self.client.motion(campaign.id, **flight)
        (row,) = [row for row in found["rows"] if row["frame_id"] == self._frames[file.path]]
        return row["forward_blur_px"]

    def take_certificate(self, version: str) -> Certificate:
        kept = self.client.export(version, self.folder / "export")
        pdf = (kept / "certificate.pdf").read_bytes()
        return Certificate(pdf=pdf, place=kept / "certificate.json", data=kept)
