"""Verdicts and advice over HTTP, from the upload on."""

import pytest
from sqlalchemy import event

from store.tables import FrameRow
from tests.support.campaigns import K_TRUE, LEVELS, ROI, list_readings

pytestmark = pytest.mark.either_database

SETTINGS = ((0.02, 4.0), (0.02, 2.8), (0.04, 2.8))
OUTSIDE = "[[8,8],[97,8],[97,56],[8,56]]"


@pytest.fixture
def campaign(house):
    """A campaign with its region and two readings of every scene, and no frame yet."""
    made = house.campaign()
    house.put(f"/v1/campaigns/{made['id']}/roi", ROI)
    house.post(f"/v1/campaigns/{made['id']}/readings", readings("level-1", "level-2"))
    return made


def readings(*scenes, **factors):
    return list_readings({scene: LEVELS[scene] for scene in scenes}, **factors)


def light(house, campaign, scene, index, *, name=None, query=None, **changes):
    """Its signal is that of its scene and settings, where none is given."""
    name = name or f"{scene}-{index}.DNG"
    settings = dict(zip(("exposure_time_s", "f_number"), SETTINGS[index], strict=True)) | changes
    light_per_k = settings["exposure_time_s"] * 3200 * LEVELS[scene] / settings["f_number"] ** 2
    content = house.frame_bytes(**{"signal_dn": K_TRUE * light_per_k, "seed": sum(name.encode())} | settings)
    return house.upload(campaign, content, role="light", filename=name, **{"scene": scene} | (query or {}))


def dark(house, campaign, index, *, name=None, signal_dn=0.0):
    content = house.frame_bytes(signal_dn=signal_dn, exposure_time_s=0.02, seed=100 + index)
    return house.upload(campaign, content, role="dark", filename=name or f"dark-{index}.DNG")


def verdict(house, frame):
    found = house.get(f"/v1/frames/{frame['id']}")["verdict"]
    return found["outcome"], [reason["code"] for reason in found["reasons"]]


def test_a_frame_from_its_upload_to_a_pass(house):
    campaign = house.campaign()
    frame = light(house, campaign, "level-1", 0)
    assert frame["verdict"]["outcome"] == "pending"
    assert [reason["code"] for reason in frame["verdict"]["reasons"]] == ["not_read"]
    assert verdict(house, frame) == ("pending", ["not_read"])
    house.work()
    assert verdict(house, frame) == ("pending", ["no_region", "reading_missing"])
    house.put(f"/v1/campaigns/{campaign['id']}/roi", ROI)
    assert verdict(house, frame) == ("pending", ["not_extracted", "reading_missing"])
    house.work()
    assert verdict(house, frame) == ("pending", ["reading_missing"])
    house.post(f"/v1/campaigns/{campaign['id']}/readings", readings("level-1"))
    assert verdict(house, frame) == ("pass", [])
    moved = house.patch(f"/v1/frames/{frame['id']}", {"scene": "level-9"})
    assert (moved["state"], house.work()) == ("extracted", 0)
    assert verdict(house, frame) == ("pending", ["reading_missing"])


def test_every_fault_has_its_reason_and_no_other_frame_any(house, campaign):
    for scene in ("level-1", "level-2"):
        for index in range(len(SETTINGS)):
            light(house, campaign, scene, index)
    for index in range(3):
        dark(house, campaign, index)
    light(house, campaign, "level-1", 0, name="clipped.DNG", signal_dn=5000.0, f_number=1.7)
    light(house, campaign, "level-1", 1, name="repeat.DNG")
    light(house, campaign, "level-2", 0, name="weak.DNG", f_number=15.0)
    light(house, campaign, "level-2", 0, name="dim.DNG", signal_dn=0.0, f_number=14.0)
    light(house, campaign, "level-2", 0, name="small.DNG", shape=(60, 96), f_number=3.4)
    light(house, campaign, "level-1", 0, name="nearly.DNG", signal_dn=3800.0, f_number=1.16)
    light(house, campaign, "level-1", 0, name="wrong.DNG", f_number=3.5, query={"scene": "level-2"})
    light(house, campaign, "level-1", 0, name="outside.DNG", f_number=3.6, query={"roi": OUTSIDE})
    light(house, campaign, "level-1", 0, name="other.DNG", f_number=3.7, serial="stranger")
    light(house, campaign, "level-1", 0, name="lens.DNG", f_number=3.8, lens_serial="L2")
    dark(house, campaign, 9, name="lit.DNG", signal_dn=500.0)
    # whatever is in it, nothing is asked of a frame of another role
    house.upload(campaign, house.frame_bytes(signal_dn=5000.0), role="field", filename="street.DNG")
    house.work()
    items = house.get(f"/v1/campaigns/{campaign['id']}/frames", limit=1000)["items"]
    found = {item["filename"]: item["verdict"] for item in items}
    for item in items:
        assert house.get(f"/v1/frames/{item['id']}")["verdict"] == item["verdict"]
        assert "refusal" not in item or item["verdict"]["reasons"][0]["detail"] == item["refusal"]["detail"]
    told = {
        name: (each["outcome"], [reason["code"] for reason in each["reasons"]])
        for name, each in found.items()
        if each["reasons"]
    }
    assert told == {
        "clipped.DNG": ("fail", ["clipped"]),
        "repeat.DNG": ("warn", ["redundant"]),
        "weak.DNG": ("warn", ["weak_signal"]),
        "dim.DNG": ("fail", ["too_dark"]),
        "small.DNG": ("fail", ["format_differs"]),
        "nearly.DNG": ("warn", ["nearly_clipped"]),
        "wrong.DNG": ("warn", ["scene_doubtful"]),
        "outside.DNG": ("fail", ["roi_unfit"]),
        "other.DNG": ("fail", ["refused"]),
        "lens.DNG": ("warn", ["lens_differs"]),
        "lit.DNG": ("fail", ["dark_not_dark"]),
    }
    assert {name: each["outcome"] for name, each in found.items() if name not in told} == {
        **{f"{scene}-{index}.DNG": "pass" for scene in ("level-1", "level-2") for index in range(3)},
        **{f"dark-{index}.DNG": "pass" for index in range(3)},
        "street.DNG": "pass",
    }
    assert "It would fit scene level-1." in found["wrong.DNG"]["reasons"][0]["detail"]
    assert "is 96 x 60 pixels, RGGB" in found["small.DNG"]["reasons"][0]["detail"]


def test_frames_that_were_all_refused_are_not_called_absent(house, campaign):
    for index, serial in enumerate(("stranger", "stranger", "")):
        light(house, campaign, "level-1", index, serial=serial or "another")
    house.work()
    found = house.get(f"/v1/campaigns/{campaign['id']}")
    missing = found["missing"]
    assert "frame_not_read" in {cause["code"] for cause in found["causes"]}
    assert missing[0] == "the campaign has no light frame that can be used"
    assert missing[1].startswith("3 light frames are there, none usable: 2 of them: ")
    assert "stranger" in missing[1]


def test_what_was_warned_of_when_the_frame_was_accepted(house, campaign):
    frame = light(house, campaign, "level-1", 0)
    house.work()
    with house.database.writing("test") as session:
        row = session.get_one(FrameRow, frame["id"])
        row.warnings = ["exposure_not_manual", "serial_unknown", "rendered"]
    assert verdict(house, frame) == ("warn", ["exposure_not_manual", "rendered"])


def test_the_same_bytes_again_are_not_judged_while_others_wait(house, campaign):
    frame = light(house, campaign, "level-1", 0)
    house.work()
    again = house.upload(
        campaign, (house.folder / "frame.dng").read_bytes(), status=200, role="light", scene="level-1"
    )
    assert again["id"] == frame["id"]
    assert "verdict" not in again
    assert verdict(house, frame) == ("pass", [])


def test_a_frame_with_the_name_of_another(house, campaign):
    frames = [light(house, campaign, "level-1", index, name="DJI_0001.DNG") for index in (0, 1)]
    frames.append(light(house, campaign, "level-1", 0, name="DJI_0001.DNG", seed=77))
    house.work()
    outcomes = [verdict(house, frame) for frame in frames]
    assert sorted(outcomes) == [("pass", []), ("pass", []), ("warn", ["redundant"])]


def test_as_many_queries_for_many_frames_as_for_one(house, campaign):
    statements = []
    event.listen(house.database._reader, "before_cursor_execute", lambda *said: statements.append(said[2]))

    def count(path):
        statements.clear()
        house.get(path)
        return len(statements)

    frame = light(house, campaign, "level-1", 0)
    house.work()
    paths = (
        f"/v1/frames/{frame['id']}",
        f"/v1/campaigns/{campaign['id']}/frames",
        f"/v1/campaigns/{campaign['id']}",
    )
    few = [count(path) for path in paths]
    for index in range(3):
        light(house, campaign, "level-2", index)
        dark(house, campaign, index)
    light(house, campaign, "level-1", 1, query={"roi": "[[8,8],[80,8],[80,56],[8,56]]"})
    house.work()
    assert [count(path) for path in paths] == few


def test_a_campaign_says_what_a_good_fit_lacks(house, campaign):
    for scene in LEVELS:
        for index in (1, 2):
            light(house, campaign, scene, index)
    house.work()
    path = f"/v1/campaigns/{campaign['id']}"
    house.post(f"{path}/readings", readings("level-3", factors=(1.0,)))
    found = house.get(path)
    assert found["missing"] == ["scene level-4 has no luminance reading"]
    assert found["advice"] == [
        "some luminance readings name no meter: its calibration uncertainty is not in that of K",
        "no dark frames at ISO 3200",
        "ISO 3200: 4 usable levels, add 1 more down to 4 cd/m2 or up to 80 cd/m2",
        "one aperture only at ISO 3200 (f/2.8): its f-number error cannot average out",
        "one reading of scene level-3: a lamp that drifts is not seen, read again after the frames",
    ]
    changed = house.http.patch(path, json={"recorder": "A. Meier"}).json()
    assert changed["advice"] == found["advice"]
    assert "advice" not in house.get("/v1/campaigns")["items"][0]


def test_equal_findings_of_a_campaign_are_one(house, campaign):
    """Readings of a scene without frames are one of them: no fit would use them, and nothing else says so."""
    frames = [light(house, campaign, "level-1", index) for index in (0, 1)]
    house.post(f"/v1/campaigns/{campaign['id']}/readings", readings("level-3", factors=(1.0,)))
    for frame in frames:
        house.patch(f"/v1/frames/{frame['id']}", {"scene": "level-4"})
    house.work()
    found = {each["code"]: each for each in house.get(f"/v1/campaigns/{campaign['id']}")["findings"]}
    assert found.keys() == {"reading_missing", "reading_without_frames"}
    waiting = found["reading_missing"]
    assert (waiting["severity"], waiting["count"]) == ("pending", 2)
    assert waiting["subjects"] == ["frame level-1-0.DNG", "frame level-1-1.DNG"]
    lone = found["reading_without_frames"]
    assert (lone["severity"], lone["count"]) == ("warn", 3)
    assert lone["subjects"] == ["scene level-1", "scene level-2", "scene level-3"]
    assert lone["values"]["readings"] == [2, 2, 1]
    assert lone["values"]["detail"][0] == "Scene level-1 has readings and no frames."
    assert lone["action"].startswith("Correct the name of the scene")


def test_a_campaign_s_rho_checks_its_readings(house, campaign):
    path = f"/v1/campaigns/{campaign['id']}"
    house.http.patch(path, json={"surface_reflectance": 0.5})
    lux = {"scene": "level-1", "quantity": "illuminance", "value": LEVELS["level-1"], "unit": "lx"}
    house.post(f"{path}/readings", [lux, lux])
    light(house, campaign, "level-1", 0)
    house.work()
    sentence = "luminance and illuminance of scene level-1 disagree: check both readings and rho"
    assert sentence in house.get(path)["advice"]
