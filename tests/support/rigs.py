"""A rig of two cameras in front of one board, over HTTP."""

import numpy as np

from radiometry.geometry.camera import CameraModel
from radiometry.geometry.target import Target
from simulation.boards import Mounted, View, set_up
from tests.support.frames import write_raw

LENS = CameraModel(height_px=180, width_px=240, fx_px=230, fy_px=230, cx_px=123.0, cy_px=87.0, k1=-0.2)
BOARD = Target(kind="checkerboard", columns=5, rows=4, square_size_mm=40.0)
TARGET = {name: getattr(BOARD, name) for name in ("kind", "columns", "rows", "square_size_mm")}
RIG = (Mounted(LENS, np.zeros(6)), Mounted(LENS, np.array([0.02, 0.1, 0.0, -80.0, 0.0, 10.0])))
PARAMS = {"radial_terms": 1, "tangential": False}


def photograph(house, camera, number, poses, *, scenes, publish=True):
    """Upload one camera's pictures of all triggers, fit and publish them."""
    campaign = house.post(
        "/v1/campaigns", {"camera_id": camera["id"], "method": "geometry", "target": TARGET}
    )
    studio = set_up(LENS, dark_dn=150.0, bright_dn=3000.0, noise_dn=10.0)
    random = np.random.default_rng(number)
    for name, pose in zip(scenes, poses, strict=True):
        frame = studio.photograph(View(board=BOARD, pose=RIG[number].move(pose)), random)
        path = write_raw(house.folder / "rig.dng", frame.samples_dn, serial=camera["serial"])
        house.upload(
            campaign, path.read_bytes(), role="chart", scene=name, filename=f"{camera['serial']}-{name}.DNG"
        )
    house.work()
    version = house.fit(campaign, **PARAMS)["id"]
    if not publish:
        return campaign, version
    house.publish({"id": version}, valid_from="2026-01-01T00:00:00Z")
    return campaign, version
