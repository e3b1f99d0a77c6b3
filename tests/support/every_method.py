"""A small version of every method but luminance, made over HTTP as a field team would."""

from collections.abc import Iterable

import numpy as np

from simulation.camera import Camera, change, take
from simulation.targets import COUNTING_SENSOR, FAST_LENS, plan_flats, plan_series
from tests.support.campaigns import calibrate
from tests.support.data import data_file
from tests.support.frames import write_raw
from tests.support.house import CAMERA, House

LENS = {"make": "DJI", "model": "15mm", "serial": "L1"}
CANON = {"make": "Canon", "model": "EOS 5D", "serial": "1"}
SEQUOIA = {"make": "Parrot", "model": "Sequoia", "serial": "PI040378AA6C000181"}
BOARD = {"kind": "checkerboard", "columns": 9, "rows": 6, "square_size_mm": 25.0}
PANEL_REFLECTANCE, PANEL_U = 0.18, 0.002
BANDS = {"green": "GRE", "red": "RED"}
F_NUMBERS = (2.0, 4.0)


def make_version(house: House, method: str) -> dict:
    """A version of that method, fitted and still a draft."""
    return _MAKERS[method](house)


def begin(house: House, method: str, camera: dict, **more) -> dict:
    camera = house.camera(**camera)
    return house.post("/v1/campaigns", {"camera_id": camera["id"], "method": method, **more})


def draw(house: House, campaign: dict, region: dict) -> None:
    house.put(f"/v1/campaigns/{campaign['id']}/roi", region)


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
    small = change(FAST_LENS, height_px=96, width_px=144, centre_px=(50.0, 66.0))
    return fit_flats(house, CAMERA | {"lens": LENS}, small)


def fit_flats(house: House, camera: dict, lens: Camera) -> dict:
    """A version from flat fields of a simulated lens."""
    random = np.random.default_rng(1)
    campaign = begin(house, "vignetting", camera)
    for shot in plan_flats(lens, f_numbers=F_NUMBERS, flats=2, darks=2):
        samples = take(lens, shot, random).frame.samples_dn
        content = raw_bytes(house, samples, f_number=shot.settings.f_number)
        house.upload(campaign, content, role=shot.role, filename=f"{shot.frame}.DNG")
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
    upload_views(house, campaign, (1, 3, 5, 8))
    return calibrate(house, campaign, pixel_pitch_um=6.0)


def upload_views(house: House, campaign: dict, numbers: Iterable[int]) -> None:
    """Pictures of OpenCV's board."""
    for number in numbers:
        name = f"left{number:02d}.jpg"
        content = data_file(f"checkerboard/{name}").read_bytes()
        house.upload(campaign, content, role="chart", filename=name)


def _noise(house: House) -> dict:
    camera = change(COUNTING_SENSOR, cfa="RGGB", height_px=64, width_px=64)
    campaign = begin(house, "noise", CAMERA | {"lens": LENS})
    random, times = np.random.default_rng(2), (0.002, 0.008, 0.03, 0.05)
    light = {"light_e_per_s": 500_000.0, "times_s": times, "dark_times_s": times, "role": "light"}
    for shot in plan_series(camera, **light):
        samples = take(camera, shot, random).frame.samples_dn
        time_s = shot.settings.exposure_time_s
        content = raw_bytes(house, samples, exposure_time_s=time_s, white_level_dn=16383)
        house.upload(campaign, content, role=shot.role, filename=f"{shot.frame}.DNG")
    return calibrate(house, campaign)


_MAKERS = {
    "reflectance": _reflectance,
    "vignetting": _vignetting,
    "sharpness": _sharpness,
    "geometry": _geometry,
    "noise": _noise,
}


def raw_bytes(house: House, samples, **told) -> bytes:
    names = {"serial": CAMERA["serial"], "lens_model": LENS["model"]}
    return write_raw(house.folder / "every.dng", samples, **names, **told).read_bytes()
