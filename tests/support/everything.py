"""An organisation that has one of each thing that a path can name."""

from store.software import FIT_CODE_VERSION
from tests.support.campaigns import published_campaign
from tests.support.house import House
from tests.support.measuring import measure
from tests.support.meters import METER
from tests.support.resumable import begin_upload
from tests.support.roads import evaluate, state_road

PANEL = {"serial": "RP04", "bands": [{"band": "red", "reflectance": 0.5}], "measured_on": "2026-04-01"}


def make_one_of_each(house: House) -> dict[str, str]:
    """Their ids, by the names that they have in paths. The key is none that anybody uses."""
    version = published_campaign(house, isos=(3200,))
    key = house.post("/v1/keys", {"name": "spare", "scopes": ["read"]})
    with house.with_key(key["secret"]) as browser:
        browser.post("/sign-in", data={"key": key["secret"]}, follow_redirects=False)
    campaign_id, frame_id = version["campaign_id"], version["points"][0]["frame_id"]
    window = {"row0_px": 0, "col0_px": 0, "height_px": 8, "width_px": 8}
    drawn = house.post(f"/v1/frames/{frame_id}/crops", window, status=202)
    house.work()
    other = house.post("/v1/cameras", {"make": "DJI", "model": "FC6520", "serial": "beside"})["id"]
    road = evaluate(house, state_road(house, publish=False, frames=1))
    return {
        "road_id": road["road_id"],
        "number": road["number"],
        "rig_id": house.post("/v1/rigs", {"name": "head", "camera_ids": [version["camera_id"], other]})["id"],
        "campaign_id": campaign_id,
        "camera_id": version["camera_id"],
        "calibration_id": version["id"],
        "frame_id": frame_id,
        "crop_id": house.get(f"/v1/jobs/{drawn['id']}")["result"]["crop_id"],
        "job_id": house.get("/v1/jobs")["items"][0]["id"],
        "reading_id": house.get(f"/v1/campaigns/{campaign_id}/readings")["items"][0]["id"],
        "meter_id": house.post("/v1/meters", METER)["id"],
        "panel_id": house.post("/v1/panels", PANEL)["id"],
        "key_id": key["id"],
        "session_id": house.get("/v1/sessions", key_id=key["id"])["items"][0]["id"],
        "measurement_id": measure(house, {"id": frame_id}, version)["id"],
        "upload_id": begin_upload(house, version["campaign_id"], b"raw").rpartition("/")[2],
        "recall_id": house.post("/v1/recalls", {"cause": {"software": FIT_CODE_VERSION}, "reason": "r"})[
            "id"
        ],
    }
