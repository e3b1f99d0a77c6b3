"""The time of a frame whose file states no offset: by the zone of its campaign or organisation."""

import struct

import pytest

from tests.service.test_reflectance import CAMERA, CENTRE, NAMES, PANEL
from tests.support.campaigns import ROI, calibrate, calibrated_campaign
from tests.support.data import data_file
from tests.support.every_method import begin, draw
from tests.support.frames import forget_time

pytestmark = pytest.mark.either_database

STATED = b"2026:05:01 20:00:00"


def night(house, **stated):
    campaign = house.campaign(kind="measurement", **stated)
    house.put(f"/v1/campaigns/{campaign['id']}/roi", ROI)
    return campaign


def take(house, campaign, at=STATED, *, name="night.DNG"):
    """A frame with the time of a clock of no known zone."""
    content = forget_time(house.frame_bytes(signal_dn=300.0, exposure_time_s=0.02), zone_only=True)
    assert content.count(STATED) >= 1
    frame = house.upload(campaign, content.replace(STATED, at), role="field", filename=name)
    house.work()
    return frame


def publish(house, version, start, end):
    house.publish(version, valid_from=start, valid_to=end)


def refuse(house, frame, status=409):
    return house.post("/v1/measurements", {"frame_id": frame["id"]}, status=status)["detail"]


def measure(house, frame):
    return house.measure(frame_id=frame["id"])


def test_stated_zone_decides_which_version_is_in_force(house, staged):
    """20:00 in Berlin is 18:00 in UTC; the campaign's zone counts before the organisation's, also when it is
    stated after the frame was read."""
    version = staged(calibrated_campaign, isos=(3200,))
    publish(house, version, "2026-05-01T17:30:00Z", "2026-05-01T18:30:00Z")
    campaign = night(house)
    frame = take(house, campaign)
    said = refuse(house, frame)
    assert "from 2026-05-01T06:00:00Z to 2026-05-02T08:00:00Z" in said
    assert "neither its file nor its campaign or organisation states a time zone" in said
    assert "state the campaign's time_zone" in said
    stated = house.patch("/v1/organisation", {"time_zone": "europe/berlin"})
    assert stated["time_zone"] == "Europe/Berlin"
    found = measure(house, frame)
    assert "2026-05-01T20:00:00 (Europe/Berlin, as its organisation states)" in found["calibration"]["why"]
    path = f"/v1/campaigns/{campaign['id']}"
    assert house.patch(path, {"time_zone": "+03:00"})["time_zone"] == "+03:00"
    said = refuse(house, frame)
    assert "(+03:00, as its campaign states), and no luminance calibration of its camera is in force" in said
    assert "state the campaign's time_zone" not in said
    # what was measured stays as it was measured: 18:00 in UTC
    series = {"from": "2026-05-01T17:59:00Z", "to": "2026-05-01T18:01:00Z"}
    assert [row["id"] for row in house.get("/v1/series/measurements", **series)["rows"]] == [found["id"]]
    assert "time_zone" not in house.patch(path, {"time_zone": ""})
    for wrong in ("Berlin", "+25:00", "../etc/passwd", "Europe"):
        house.patch(path, {"time_zone": wrong}, status=422)


def test_grid_states_the_instant_of_each_frame(house):
    """A zone that is stated later is another grid, whole."""
    campaign = night(house)
    take(house, campaign)
    take(house, campaign, b"2026:10:25 02:30:00", name="twice.DNG")
    house.upload(campaign, house.frame_bytes(signal_dn=300.0), role="field", filename="known.DNG")
    house.work()

    def look(**since):
        answer = house.get(f"/v1/campaigns/{campaign['id']}/grid", **since)
        frames = answer["frames"]
        return answer, list(zip(frames["filename"], frames["instant"], frames["time_zone"], strict=True))

    known, berlin = ("known.DNG", "2026-05-01T20:00:00Z", None), "Europe/Berlin"
    before, rows = look()
    assert rows == [("night.DNG", None, None), ("twice.DNG", None, None), known]
    house.patch("/v1/organisation", {"time_zone": berlin})
    after, rows = look(since=before["since"])
    night_at, twice_at = "2026-05-01T18:00:00Z", "2026-10-25T00:30:00Z"
    assert rows == [("night.DNG", night_at, berlin), ("twice.DNG", twice_at, berlin), known]
    assert not after["partial"]


def test_hour_that_a_clock_shows_twice_must_be_covered_whole(house, staged):
    version = staged(calibrated_campaign, isos=(3200,))
    campaign = night(house, time_zone="Europe/Berlin")
    twice = take(house, campaign, b"2026:10:25 02:30:00")
    publish(house, version, "2026-10-25T01:00:00Z", "2026-10-26T00:00:00Z")
    said = refuse(house, twice)
    assert "from 2026-10-25T00:30:00Z to 2026-10-25T01:30:00Z, since its clock was changed" in said
    publish(house, version, "2026-10-25T00:00:00Z", "2026-10-26T00:00:00Z")
    measure(house, twice)


def test_clock_that_was_never_set_is_named_as_the_cause(house, staged):
    publish(house, staged(calibrated_campaign, isos=(3200,)), "2026-05-01T00:00:00Z", "2026-05-02T00:00:00Z")
    frame = take(house, night(house, time_zone="Europe/Berlin"), b"1970:01:01 00:03:00")
    said = refuse(house, frame, 422)
    assert "The camera's clock was not set: frame night.DNG states 1970-01-01T00:03:00" in said


def make_flights(house):
    """Two flights of one day, each with its panel and its own K."""
    house.post("/v1/panels", PANEL)
    made = []
    for hour in (b"08", b"15"):
        campaign = begin(house, "reflectance", CAMERA)
        draw(house, campaign, CENTRE)
        content = data_file(f"sequoia/{NAMES['green']}").read_bytes()
        content = content.replace(b"2018:04:13 08:", b"2018:04:13 %s:" % hour)
        house.upload(campaign, content, role="panel", filename="panel.TIF")
        # another shot of the same place: its bytes must differ
        shot = struct.pack("<I", len(made)) + b"field"
        frame = house.upload(campaign, content + shot, role="field", filename="field.TIF")
        made.append((calibrate(house, campaign), frame))
    return made


@pytest.fixture
def flights(staged):
    return staged(make_flights)


def test_each_flight_of_a_day_is_measured_with_its_own_k(house, flights):
    """Both are published for the day, as the documentation says; the second takes the place of the first."""
    for version, _ in flights:
        publish(house, version, "2018-04-13T00:00:00Z", "2018-04-14T00:00:00Z")
    for version, frame in flights:
        assert measure(house, frame)["calibration"]["id"] == version["id"]
    # a revoked one is nobody's: the day's other version is in force
    (first, frame), (second, _) = flights
    house.revoke(first)
    assert measure(house, frame)["calibration"]["id"] == second["id"]


def test_files_that_are_in_utc_need_no_zone(house, flights):
    """A Sequoia states no offset and writes UTC: a version for an hour is in force in that hour."""
    (version, _), (_, late) = flights
    publish(house, version, "2018-04-13T15:00:00Z", "2018-04-13T16:00:00Z")
    assert measure(house, late)["calibration"]["id"] == version["id"]
