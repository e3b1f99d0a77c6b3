"""Frames of full length with an empty part: left out of fits, and measured only when asked for by name."""

import pytest

from store.tables import FrameRow
from tests.support.campaigns import (
    ISOS,
    K_TRUE,
    LEVELS,
    ROI,
    SETTINGS,
    calibrate,
    published_campaign,
    upload_campaign,
)
from tests.support.frames import empty_lower_half

pytestmark = pytest.mark.either_database

PER_DN = 4.0**2 / (K_TRUE * 0.02 * 3200)
BROKEN = ["image_part_empty"]


def upload_field(house, campaign, *, change=lambda content: content, name="field.DNG"):
    content = house.frame_bytes(signal_dn=20.0 / PER_DN, exposure_time_s=0.02, f_number=4.0, iso=3200)
    frame = house.upload(campaign, change(content), role="field", filename=name)
    house.work()
    return house.get(f"/v1/frames/{frame['id']}")


def field_campaign(house):
    campaign = house.campaign()
    house.put(f"/v1/campaigns/{campaign['id']}/roi", ROI)
    return campaign


def ask(house, frame, **more):
    return house.http.post("/v1/measurements", json={"frame_id": frame["id"], **more})


@pytest.fixture
def version(staged):
    return staged(published_campaign, isos=(3200,))


@pytest.mark.usefixtures("version")
def test_a_field_frame_with_an_empty_half_is_measured_by_name_only(house):
    campaign = field_campaign(house)
    whole = upload_field(house, campaign)
    cut = upload_field(house, campaign, change=empty_lower_half, name="cut.DNG")
    assert "image_part_empty" not in whole["warnings"]
    assert "image_part_empty" in cut["warnings"]
    refused = ask(house, cut)
    assert (refused.status_code, refused.json()["code"]) == (422, "image_part_empty")
    assert "rows 32 to 63, 50.00% of it" in refused.json()["detail"]
    both = house.http.post(f"/v1/campaigns/{campaign['id']}/measurements", json={}).json()
    assert [(each["filename"], each["code"]) for each in both["not_measured"]] == [
        ("cut.DNG", "image_part_empty")
    ]
    allowed = ask(house, cut, allow=BROKEN)
    assert allowed.status_code == 202, allowed.text
    house.work()
    done = house.get(f"/v1/jobs/{allowed.json()['id']}")
    found = house.get(f"/v1/measurements/{done['result']['measurement_id']}")
    raised = next(each for each in found["flags"] if each["flag"] == "image_part_empty")
    assert "rows 32 to 63" in raised["detail"]
    # what it would have been without a word: less than half of the 20 cd/m2 that were there
    assert found["mean"]["value"] < 10
    assert ask(house, whole, allow=["rendered"]).status_code == 422


@pytest.mark.usefixtures("version")
def test_a_frame_that_was_read_before_there_were_proofs_is_looked_at_first(house):
    cut = upload_field(house, field_campaign(house), change=empty_lower_half)
    with house.database.writing("test") as session:
        row = session.get_one(FrameRow, cut["id"])
        row.proof, row.warnings = None, []
    job = ask(house, cut).json()
    house.work()
    done = house.get(f"/v1/jobs/{job['id']}")
    assert (done["state"], done["error"]["code"]) == ("failed", "image_part_empty")


def test_light_and_dark_frames_with_empty_halves_change_no_fit(house, staged):
    campaign = staged(upload_campaign, isos=ISOS[:1])
    exposure_time_s, f_number = SETTINGS[0]
    settings = {"exposure_time_s": exposure_time_s, "f_number": f_number, "iso": ISOS[0]}
    signal = K_TRUE * exposure_time_s * ISOS[0] * LEVELS["level-2"] / f_number**2
    for signal_dn, more in ((signal, {"role": "light", "scene": "level-2"}), (0.0, {"role": "dark"})):
        content = empty_lower_half(house.frame_bytes(signal_dn=signal_dn, seed=77, **settings))
        house.upload(campaign, content, filename=f"cut-{more['role']}.DNG", **more)
    fitted = calibrate(house, campaign)
    assert next(c["value"] for c in fitted["coefficients"] if c["name"] == "luminance_k") == pytest.approx(
        K_TRUE, rel=0.01
    )
    (cut,) = (point for point in fitted["points"] if point["frame"] == "cut-light.DNG")
    assert not cut["used"]
    assert cut["left_out"].startswith("excluded by stilb: the image is empty in rows 32 to 63")
    verdicts = house.get(f"/v1/campaigns/{campaign['id']}/frames")["items"]
    failed = {each["filename"]: each["verdict"] for each in verdicts if each["filename"].startswith("cut")}
    assert {verdict["outcome"] for verdict in failed.values()} == {"fail"}
