"""One night's work as people look at it afterwards: a calibrated camera, and a lit road on two dates."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

import stilb
from tests.support.campaigns import K_TRUE
from tests.support.fieldwork import Team, write_campaign
from tests.support.frames import write_frame

SHAPE = (192, 288)
ROAD = ((40.0, 24.0), (250.0, 24.0), (276.0, 168.0), (12.0, 168.0))
GRID = {"corners": [list(corner) for corner in ROAD], "rows": 3, "columns": 5}
_SETTINGS = {"exposure_time_s": 0.02, "f_number": 4.0, "iso": 3200}
_PER_DN = 4.0**2 / (K_TRUE * 0.02 * 3200)


@dataclass(frozen=True, kw_only=True)
class Night:
    """``version`` is published; ``old`` and ``new`` show one road, of which a lamp fell out in between."""

    team: Team
    campaign_id: str
    measured_id: str
    """Campaign of the field frames."""
    camera_id: str
    version: stilb.Calibration
    field: tuple[stilb.Frame, stilb.Frame]
    old: stilb.Measurement
    new: stilb.Measurement


def work_a_night(team: Team, folder: Path) -> Night:
    campaign = team.campaign()
    shots = write_campaign(folder)
    team.push(campaign, shots)
    dark_hours = team.client.create_campaign(
        campaign.camera_id, kind="measurement", project_number="Mill Road"
    )
    field = [
        team.client.push(dark_hours.id, _photograph(folder / name, lamps, seed), role="field")
        for name, lamps, seed in (
            ("road-may.DNG", (1.0, 1.0, 1.0), 3),
            ("road-june.DNG", (1.0, 0.25, 1.0), 4),
        )
    ]
    for frame in (*team.client.frames(dark_hours.id), *team.client.frames(campaign.id)):
        team.client.wait(frame.job_id)
    version = team.client.calibrate(campaign.id, model="proportional")
    team.client.publish(version.id, valid_from="2026-04-01T00:00:00Z", reason="spring, reviewed by A. Meier")
    old, new = (
        team.client.measure(
            frame.id, polygon=ROAD, grid=GRID, reflectance=0.08, mains_frequency_hz=50.0, with_map=True
        )
        for frame in field
    )
    return Night(
        team=team,
        campaign_id=campaign.id,
        measured_id=dark_hours.id,
        camera_id=campaign.camera_id,
        version=version,
        field=(field[0], field[1]),
        old=old,
        new=new,
    )


def _photograph(path: Path, lamps: tuple[float, ...], seed: int) -> Path:
    """Pools of light along a road, and one bright sign that saturates."""
    row, col = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float)
    luminance = np.full(SHAPE, 0.15)
    for place, lamp in enumerate(lamps):
        distance2 = (row - 100.0) ** 2 / 70.0**2 + (col - (60.0 + 84.0 * place)) ** 2 / 40.0**2
        luminance += 24.0 * lamp * np.exp(-distance2)
    luminance[6:14, 130:150] = 900.0
    return write_frame(path, signal_dn=luminance / _PER_DN, shape=SHAPE, seed=seed, **_SETTINGS)
