"""K with vignetting: measured in a corner, through every step over HTTP."""

from dataclasses import replace

import numpy as np
import pytest

from radiometry.luminance.rows import Params
from simulation.camera import change, take
from simulation.targets import FAST_LENS, plan_flats
from store.codec import encode
from store.fits import hash_content
from store.tables import Calibration
from tests.support.campaigns import calibrate, list_readings
from tests.support.every_method import draw, raw_bytes
from tests.support.frames import write_frame
from tests.support.measuring import read_map

pytestmark = pytest.mark.either_database

LENS = change(FAST_LENS, height_px=96, width_px=144, centre_px=(50.0, 68.0))
K, ISO = 2.0, 3200
SETTINGS = ((0.005, 2.0), (0.01, 2.8))
LEVELS = {"level-1": 40.0, "level-2": 20.0, "level-3": 5.0}
CENTRE = {"polygon": [[56, 34], [86, 34], [86, 62], [56, 62]]}
CORNER = {"polygon": [[112, 70], [140, 70], [140, 92], [112, 92]]}


def fit_falloff(house, *, f_numbers=(2.0, 4.0), seed=1):
    """The vignetting of the lens; between two f-numbers it is interpolated."""
    campaign = house.campaign(method="vignetting")
    random = np.random.default_rng(seed)
    for shot in plan_flats(LENS, f_numbers=f_numbers, flats=2, darks=1):
        samples = take(LENS, shot, random).frame.samples_dn
        content = raw_bytes(house, samples, f_number=shot.settings.f_number)
        house.upload(campaign, content, role=shot.role, filename=f"{shot.frame}.DNG")
    return calibrate(house, campaign)


def frame_bytes(house, luminance, exposure_time_s, f_number, *, seed=1):
    signal = K * exposure_time_s * ISO * luminance / f_number**2 * LENS.share(f_number)
    changes = {"exposure_time_s": exposure_time_s, "f_number": f_number, "iso": ISO, "seed": seed}
    path = house.folder / "lit.dng"
    return write_frame(path, signal_dn=signal, shape=signal.shape, **changes).read_bytes()


def lit_campaign(house):
    campaign = house.campaign()
    draw(house, campaign, CENTRE)
    for index, settings in enumerate(SETTINGS):
        dark = frame_bytes(house, 0.0, *settings, seed=90 + index)
        house.upload(campaign, dark, role="dark", filename=f"dark-{index}.DNG")
        for number, (scene, luminance) in enumerate(LEVELS.items()):
            light = frame_bytes(house, luminance, *settings, seed=10 * index + number)
            house.upload(campaign, light, role="light", scene=scene, filename=f"{scene}-{index}.DNG")
    rows = list_readings(LEVELS, factors=(0.999, 1.001))
    house.post(f"/v1/campaigns/{campaign['id']}/readings", rows)
    house.work()
    return campaign


def prepare(house):
    """A vignetting version, and a campaign that waits for its fit."""
    return fit_falloff(house), lit_campaign(house)


def field_frame(house, campaign, luminance=20.0, f_number=2.0, name="field.DNG"):
    frame = house.upload(
        campaign, frame_bytes(house, luminance, 0.005, f_number, seed=7), role="field", filename=name
    )
    house.work()
    return frame


def measure(house, frame, version, **asked):
    # as in the laboratory: of what was calibrated
    field = {"spectral_mismatch_u_rel": 0.0, "lamp_modulation": 0.0}
    body = {"frame_id": frame["id"], "calibration_id": version["id"]} | field | asked
    return house.measure(**body)


def flags(found):
    return {raised["flag"] for raised in found["flags"]}


def ask(house, campaign, **params):
    return house.http.post(f"/v1/campaigns/{campaign['id']}/calibrations", json=params)


def test_a_corner_is_wrong_by_the_falloff_without_and_right_with(house, staged):
    falloff, campaign = staged(prepare)
    without = calibrate(house, campaign)
    version = calibrate(house, campaign, vignetting_id=falloff["id"])
    check_version(house, without, version, falloff)

    frame = field_frame(house, campaign)
    corner = LENS.share(2.0)[70:92, 112:140].mean()
    centre = LENS.share(2.0)[34:62, 56:86].mean()
    dark = measure(house, frame, without, roi=CORNER)
    assert dark["mean"]["value"] == pytest.approx(20.0 * corner / centre, rel=0.02)
    assert dark["mean"]["value"] < 20.0 - 3 * dark["mean"]["standard_uncertainty"]
    assert (dark["vignetting"], "lens_share" in dark) == ("none", False)
    assert {"no_vignetting_correction", "roi_elsewhere"} <= flags(dark)

    grid = {"corners": [[4, 4], [140, 4], [140, 92], [4, 92]], "rows": 3, "columns": 4}
    found = measure(house, frame, version, roi=CORNER, grid=grid, products=["map"])
    assert abs(found["mean"]["value"] - 20.0) < 2 * found["mean"]["standard_uncertainty"]
    assert found["vignetting"] == falloff["id"]
    assert found["lens_share"]["value"] == pytest.approx(corner, rel=0.01)
    assert not {"no_vignetting_correction", "roi_elsewhere"} & flags(found)
    assert {row["source"] for row in found["budget"]} >= {"vignetting", "fit of K"}
    # U of a place has the uncertainty of V there, which is larger in the corners
    layer = house.get(f"/v1/measurements/{found['id']}/map.json", layer="expanded_uncertainty_rel")["values"]
    dimmest = found["min"]
    of_pixel = 2 * dimmest["standard_uncertainty"] / dimmest["value"]
    assert layer[81][126] == pytest.approx(of_pixel, rel=0.1)
    assert layer[94][142] > layer[48][72]
    # an even surface: pixels differ by noise, and all cells are alike
    assert found["min"]["value"] < 20.0 < found["max"]["value"]
    assert abs(found["median"]["value"] - found["mean"]["value"]) < 0.2
    cells = np.array([[cell["value"] for cell in line] for line in found["grid"]["cells"]])
    assert cells == pytest.approx(np.full((3, 4), cells.mean()), rel=0.01)
    u_o = found["u_o"]
    assert abs(u_o["value"] - 1.0) < 3 * u_o["standard_uncertainty"] + 0.01
    check_map(house, found, falloff)
    check_revoking(house, falloff, frame, version, found)


def check_version(house, without, version, falloff):
    assert "vignetting" not in without["parameters"]
    assert "vignetting" not in without["inputs"]
    text = str(without["diagnostics"]) + str(without["points"])
    assert ("vignetting" in text, "lens_share" in text) == (False, False)
    assert version["parameters"]["vignetting"] == falloff["content_sha256"]
    assert version["inputs"]["vignetting"][0]["content_sha256"] == falloff["content_sha256"]
    assert version["content_sha256"] != without["content_sha256"]
    k = next(row for row in version["coefficients"] if row["name"] == "luminance_k")
    assert abs(k["value"] - K) < 2 * k["standard_uncertainty"]
    with house.database.reading() as session:
        row, plain = (session.get_one(Calibration, each["id"]) for each in (version, without))
    fitted = row.result["iso_fits"][0]
    assert fitted["coefficient"]["vignetting"] == falloff["content_sha256"]
    assert "vignetting" not in plain.result["iso_fits"][0]["coefficient"]
    assert {entry["source"] for entry in fitted["budget"]} >= {"vignetting"}
    assert hash_content(plain.inputs, plain.parameters) == plain.content_sha256
    point = next(point for point in row.result["points"] if point["f_number"] == 2.0)
    share = point["lens_share"]["value"]
    assert share == pytest.approx(LENS.share(2.0)[34:62, 56:86].mean(), rel=0.005)
    adjusted = (point["signal_dn"] - point["dark_signal_dn"]) / share
    assert point["adjusted_signal_dn"] == pytest.approx(adjusted, rel=1e-12)


def check_map(house, found, falloff):
    plane, said, _ = read_map(house, found)
    assert falloff["content_sha256"] in str(said)
    corner = plane[70:92, 112:140]
    assert np.mean(corner) == pytest.approx(found["mean"]["value"], rel=0.005)
    # by rings around the centre: even to the noise of their means
    assert plane[40:60, 60:80].mean() == pytest.approx(plane[:16, :16].mean(), rel=0.02)


def check_revoking(house, falloff, frame, version, found):
    answer = house.revoke(falloff)
    assert [touched["measurement_id"] for touched in answer["measurements"]] == [found["id"]]
    again = house.get(f"/v1/measurements/{found['id']}")
    assert "calibration_revoked" in flags(again)
    body = {"frame_id": frame["id"], "calibration_id": version["id"], "roi": CENTRE}
    assert house.post("/v1/measurements", body, status=409)["code"] == "calibration_revoked"


def test_which_version_corrects_is_decided_when_the_fit_is_asked_for(house, staged):
    falloff, campaign = staged(prepare)
    refused = ask(house, campaign, vignetting_id="in_force")
    assert (refused.status_code, refused.json()["code"]) == (409, "no_calibration_in_force")
    house.publish(falloff)
    assert ask(house, campaign, vignetting_id="in_force").status_code == 202
    later = fit_falloff(house, seed=2)
    house.publish(later)
    house.work()
    (version,) = house.get(f"/v1/campaigns/{campaign['id']}/calibrations")["items"]
    assert version["parameters"]["vignetting"] == falloff["content_sha256"]
    assert ask(house, campaign, vignetting_id="cal_of_nobody").status_code == 404
    refused = ask(house, campaign, vignetting_id=version["id"])
    assert (refused.status_code, refused.json()["code"]) == (409, "method_mismatch")
    other = house.post("/v1/campaigns", {"camera_id": house.camera()["id"], "method": "noise"})
    refused = ask(house, other, vignetting_id="in_force")
    assert [error["field"] for error in refused.json()["errors"]] == ["body.vignetting_id"]


def test_outside_the_f_numbers_nothing_is_extrapolated(house, staged):
    _, campaign = staged(prepare)
    falloff = fit_falloff(house, f_numbers=(2.8, 4.0), seed=3)
    refused = ask(house, campaign, vignetting_id=falloff["id"])
    assert (refused.status_code, refused.json()["code"]) == (422, "vignetting_not_calibrated")
    assert "f/2 is outside the calibrated range, f/2.8 to f/4" in refused.json()["detail"]
    frames = house.get(f"/v1/campaigns/{campaign['id']}/frames")["items"]
    out = [frame["id"] for frame in frames if frame["f_number"] == 2.0]
    exclude = [{"frame_id": frame_id, "reason": "no flats at f/2"} for frame_id in out]
    version = calibrate(house, campaign, vignetting_id=falloff["id"], exclude=exclude)
    frame = field_frame(house, campaign)
    body = {"frame_id": frame["id"], "calibration_id": version["id"], "roi": CORNER}
    assert house.post("/v1/measurements", body, status=422)["code"] == "vignetting_not_calibrated"


def test_what_is_not_said_changes_no_content():
    plain = encode(Params())
    assert "vignetting" not in plain
    assert plain["panel_rho"] is None
    assert encode(replace(Params(), vignetting="00"))["vignetting"] == "00"
