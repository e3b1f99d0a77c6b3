"""A small version of every method but luminance, made over HTTP as a field team would."""

from datetime import UTC, datetime

import numpy as np

from demo.dng import Camera, write_dng
from demo.exif import Exposure
from simulation.noise import SimulatedSensor, expose
from simulation.vignetting import SimulatedLens, simulate_campaign
from tests.support.campaigns import calibrate
from tests.support.data import data_file
from tests.support.house import CAMERA, House

LENS = {"make": "DJI", "model": "15mm", "serial": "L1"}
CANON = {"make": "Canon", "model": "EOS 5D", "serial": "1"}
SEQUOIA = {"make": "Parrot", "model": "Sequoia", "serial": "PI040378AA6C000181"}
BOARD = {"kind": "checkerboard", "columns": 9, "rows": 6, "square_size_mm": 25.0}
PANEL_REFLECTANCE, PANEL_U = 0.18, 0.002
BANDS = {"green": "GRE", "red": "RED"}
F_NUMBERS = (2.0, 4.0)
SYSTEM_GAIN_DN_PER_E = 0.5


def make_version(house: House, method: str) -> dict:
    """A version of that method, fitted and still a draft."""
    return _MAKERS[method](house)


def begin(house: House, method: str, camera: dict, **more) -> dict:
    camera = house.camera(**camera)
    return house.post("/v1/campaigns", {"camera_id": camera["id"], "method": method, **more})


def draw(house: House, campaign: dict, region: dict) -> None:
    answer = house.http.put(f"/v1/campaigns/{campaign['id']}/roi", json=region)
    assert answer.status_code == 200, answer.text


def upload_panels(house: House, campaign: dict) -> None:
    for name in BANDS.values():
        filename = f"IMG_180413_080658_0000_{name}.TIF"
        content = data_file(f"sequoia/{filename}").read_bytes()
        house.upload(campaign, content, role="panel", filename=filename)


def register_panel(house: House, *, serial="P-18", reflectance=PANEL_REFLECTANCE, u=PANEL_U) -> dict:
    told = {"reflectance": reflectance} | ({"standard_uncertainty": u} if u else {})
    bands = [{"band": band, **told} for band in BANDS]
    answer = house.http.post(
        "/v1/panels", json={"serial": serial, "measured_on": "2018-03-01", "bands": bands}
    )
    assert answer.status_code in {200, 201}, answer.text
    return answer.json()


def reflectance_campaign(house: House) -> dict:
    campaign = begin(house, "reflectance", SEQUOIA)
    draw(house, campaign, {"polygon": [[600, 440], [680, 440], [680, 520], [600, 520]]})
    upload_panels(house, campaign)
    return campaign


def _reflectance(house: House) -> dict:
    panel = register_panel(house)
    return calibrate(house, reflectance_campaign(house), panel_id=panel["id"])


def _vignetting(house: House) -> dict:
    lens = SimulatedLens(height_px=96, width_px=144, centre_px=(50.0, 66.0))
    campaign = begin(house, "vignetting", CAMERA | {"lens": LENS})
    for shot in simulate_campaign(lens, np.random.default_rng(1), f_numbers=F_NUMBERS, flats=2, darks=2):
        content = _raw_bytes(house, shot.frame.samples_dn, f_number=shot.exposure.f_number)
        house.upload(campaign, content, role=shot.role, filename=f"{shot.name}.DNG")
    return calibrate(house, campaign)


def _sharpness(house: House) -> dict:
    campaign = begin(house, "sharpness", CANON, target={"kind": "slanted_edge"})
    edge = {"name": "centre", "polygon": [[0, 0], [343, 0], [343, 124], [0, 124]]}
    draw(house, campaign, {"regions": [edge]})
    content = data_file("edge/Test_edge1.tif").read_bytes()
    house.upload(campaign, content, role="chart", filename="edge.tif")
    return calibrate(house, campaign, pixel_pitch_um=5.0)


def _geometry(house: House) -> dict:
    campaign = begin(house, "geometry", CANON, target=BOARD)
    for number in (1, 3, 5, 8):
        name = f"left{number:02d}.jpg"
        content = data_file(f"checkerboard/{name}").read_bytes()
        house.upload(campaign, content, role="chart", filename=name)
    return calibrate(house, campaign, pixel_pitch_um=6.0)


def _noise(house: House) -> dict:
    sensor = SimulatedSensor(
        cfa="RGGB",
        rows=64,
        cols=64,
        white_level_dn=16383.0,
        system_gain_dn_per_e=SYSTEM_GAIN_DN_PER_E,
    )
    campaign = begin(house, "noise", CAMERA)
    rng = np.random.default_rng(2)
    for index, exposure_time_s in enumerate((0.002, 0.008, 0.03, 0.05)):
        for role, light in (("light", 500_000.0), ("dark", 0.0)):
            for take in (1, 2):
                frame = expose(sensor, rng, light_e_per_s=light, exposure_time_s=exposure_time_s)
                content = _raw_bytes(house, frame.samples_dn, exposure_time_s=exposure_time_s, white=16383)
                house.upload(campaign, content, role=role, filename=f"{role}-{index}-{take}.DNG")
    return calibrate(house, campaign)


_MAKERS = {
    "reflectance": _reflectance,
    "vignetting": _vignetting,
    "sharpness": _sharpness,
    "geometry": _geometry,
    "noise": _noise,
}


def _raw_bytes(house: House, samples, *, exposure_time_s=0.01, f_number=4.0, white=4095) -> bytes:
    path = house.folder / "every.dng"
    exposure = Exposure(
        exposure_time_s=exposure_time_s,
        f_number=f_number,
        iso=100,
        taken_at=datetime(2026, 5, 1, 12, 0, tzinfo=UTC),
        body_serial=CAMERA["serial"],
        lens_make=LENS["make"],
        lens_model=LENS["model"],
        lens_serial=LENS["serial"],
        focal_length_mm=15.0,
    )
    camera = Camera(black_level_dn=256, white_level_dn=white, serial=CAMERA["serial"])
    write_dng(path, samples, camera=camera, exposure=exposure)
    return path.read_bytes()
