"""A small campaign on disk, and a field team that goes its way over HTTP in an organisation of its own."""

import uuid
from dataclasses import dataclass
from pathlib import Path

import httpx

import stilb
from tests.support.campaigns import ISOS, K_TRUE, LEVELS, ROI, SETTINGS, list_readings
from tests.support.frames import write_frame
from tests.support.house import CAMERA
from tests.support.waiting import NO_TLS

Figures = list[tuple[str, float, float, float]]


@dataclass(frozen=True, kw_only=True)
class Shot:
    path: Path
    role: str
    scene: str | None


def write_campaign(folder: Path, *, isos=ISOS, **more) -> list[Shot]:
    """The frames of `tests.support.campaigns`, as files that a client sends; ``more`` : see `write_frame`."""
    shots = []
    for iso in isos:
        for index, (exposure_time_s, f_number) in enumerate(SETTINGS):
            scenes = {None: 0.0} | LEVELS
            for number, (scene, luminance) in enumerate(scenes.items()):
                path = write_frame(
                    folder / f"{scene or 'dark'}-{iso}-{index}.DNG",
                    signal_dn=K_TRUE * exposure_time_s * iso * luminance / f_number**2,
                    exposure_time_s=exposure_time_s,
                    f_number=f_number,
                    iso=iso,
                    seed=1 + 100 * number + index + iso,
                    **more,
                )
                shots.append(Shot(path=path, role="light" if scene else "dark", scene=scene))
    return shots


def write_field_folder(folder: Path, **more) -> None:
    """Write the folder of docs/http.md: a folder per light level, one of dark frames, the readings."""
    raw = folder / "raw"
    raw.mkdir(parents=True)
    for shot in write_campaign(raw, **more):
        target = folder / (shot.scene or "dark")
        target.mkdir(exist_ok=True)
        shot.path.rename(target / shot.path.name)
    raw.rmdir()
    lines = [f"{scene},luminance,{value},cd/m2" for scene, value in LEVELS.items()]
    (folder / "readings.csv").write_text("\n".join(["scene,quantity,value,unit", *lines]) + "\n")


class Team:
    """One organisation's client. What another team has sent or computed is of no use to this one."""

    def __init__(self, url: str, key: str, **settings):
        self.url = url
        self.key = key
        self.client = stilb.Client(url, key, **{"retries": 10} | settings)

    def __enter__(self):
        self.client.__enter__()
        return self

    def __exit__(self, *error):
        self.client.__exit__(*error)

    def campaign(self) -> stilb.Campaign:
        """A campaign with its region and its readings, and no frame yet."""
        camera = self.client.create_camera(**CAMERA)
        campaign = self.client.create_campaign(camera.id)
        self.client.set_roi(campaign.id, polygon=ROI["polygon"])
        self.client.add_readings(campaign.id, list_readings())
        return campaign

    def push(self, campaign: stilb.Campaign, shots: list[Shot]) -> list[stilb.Frame]:
        return self.client.push_all(
            [
                stilb.Upload(campaign_id=campaign.id, path=shot.path, role=shot.role, scene=shot.scene)
                for shot in shots
            ]
        )

    def http(self, **settings) -> httpx.Client:
        """For what the client would not do."""
        headers = {"Authorization": f"Bearer {self.key}"}
        return httpx.Client(base_url=self.url, headers=headers, timeout=60.0, verify=NO_TLS, **settings)


def new_team(url: str, operator_key: str, **settings) -> Team:
    """Found an organisation, whose first key the team gets."""
    headers = {"Authorization": f"Bearer {operator_key}"}
    body = {"name": str(uuid.uuid4())}
    answer = httpx.post(f"{url}/v1/organisations", json=body, headers=headers, timeout=60.0, verify=NO_TLS)
    assert answer.status_code == 201, answer.text
    return Team(url, answer.json()["key"]["secret"], **settings)


def figures_of(calibration: stilb.Calibration) -> Figures:
    """Every coefficient and its uncertainty, to be compared to the last bit."""
    return [(c.name, c.iso, c.value, c.standard_uncertainty) for c in calibration.coefficients]
