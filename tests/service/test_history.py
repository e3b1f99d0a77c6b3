"""What publishing would change, and what revoking touches: figures against a second measurement."""

import pytest

from tests.support.campaigns import K_TRUE, calibrate
from tests.support.measuring import field_frame, measure
from tests.support.meters import add_readings, enter_meter, metered_campaign, withdraw_readings

pytestmark = pytest.mark.either_database

APRIL, MAY, TAKEN = "2026-04-01T00:00:00Z", "2026-05-10T00:00:00Z", "2026-05-01T20:00:00Z"
PERIODS = ("in_force", "revoked_from")


def publish(house, version, valid_from=APRIL, **more):
    house.publish(version, valid_from=valid_from, **more)


def impact(house, version, **params):
    return house.get(f"/v1/calibrations/{version['id']}/impact", **params)


def make_pair(house):
    meter = enter_meter(house)
    first = calibrate(house, metered_campaign(house, meter, isos=(3200, 6400)))
    second = calibrate(house, metered_campaign(house, meter, factor=1.05))
    return first, second


@pytest.fixture
def pair(staged):
    """Two versions by one meter; the second's readings were 5 % higher, and it lacks ISO 6400."""
    return staged(make_pair)


def make_metered_version(house):
    return calibrate(house, metered_campaign(house, enter_meter(house)))


def test_a_revoked_version_lists_its_measurements_with_what_the_next_would_say(house, pair):
    first, second = pair
    publish(house, first)
    frame = field_frame(house, first["campaign_id"])
    made = measure(house, frame, first)
    again = measure(house, frame, second)
    publish(house, second)
    answer = house.revoke(first)
    assert (answer["state"], answer["roads"]) == ("revoked", [])
    (touched,) = answer["measurements"]
    assert touched["measurement_id"] == made["id"]
    assert (touched["frame_id"], touched["filename"]) == (frame["id"], frame["filename"])
    assert touched["taken_at"].startswith("2026-05-01T")
    assert touched["successor"] == {"calibration_id": second["id"], "version": 2}
    assert touched["basis"] == "signal"
    expected = 100 * (again["mean"]["value"] / made["mean"]["value"] - 1)
    assert touched["change"]["value"] == pytest.approx(expected, rel=1e-9)
    assert touched["change"]["value"] == pytest.approx(5.0, abs=0.5)
    assert touched["change"]["unit"] == "%"
    # both hang on one certificate of 1 %, which scales them alike
    k = [next(c for c in v["coefficients"] if c.get("f_number") == 4.0) for v in (first, second)]
    squares = sum((c["standard_uncertainty"] / c["value"]) ** 2 for c in k) - 2 * 0.01**2
    assert touched["change"]["standard_uncertainty"] == pytest.approx(
        (100 + touched["change"]["value"]) * squares**0.5, rel=1e-9
    )
    assert house.revoke(first)["measurements"] == answer["measurements"]


def test_a_successor_is_what_is_in_force_then_and_has_no_figure_without_the_iso(house, pair):
    first, second = pair
    publish(house, first)
    before = impact(house, second, at="2026-03-31T23:59:59Z")
    assert "Nothing is in force then" in before["said"]
    assert "against" not in before
    assert before["coefficients"] == before["measurements"] == []
    assert impact(house, second, at=APRIL)["against"]["version"] == 1
    itself = impact(house, first)
    assert "itself is in force" in itself["said"]
    assert {row["difference"]["value"] for row in itself["coefficients"]} == {0.0}
    measure(house, field_frame(house, first["campaign_id"], iso=6400), first)
    for period in ({"valid_from": MAY}, {"valid_from": APRIL, "valid_to": TAKEN}):
        publish(house, second, **period)
        (touched,) = house.revoke(first)["measurements"]
        assert {"successor", "change"}.isdisjoint(touched)
        assert touched["why"] == "No other version is in force when the frame was taken."
    publish(house, second)
    (touched,) = house.revoke(first)["measurements"]
    assert touched["successor"]["version"] == 2
    assert "change" not in touched
    assert "ISO 6400" in touched["why"]


def test_the_impact_names_every_change(house, pair):
    first, second = pair
    publish(house, first)
    made = measure(house, field_frame(house, first["campaign_id"]), first)
    found = impact(house, second, at=TAKEN)
    assert "Version 1 is in force then" in found["said"]
    assert found["against"]["calibration_id"] == first["id"]
    assert found["against"]["valid_from"] == APRIL
    k = next(row for row in found["coefficients"] if row["name"] == "luminance_k")
    assert [(row["iso"], row.get("f_number")) for row in found["coefficients"]] == [
        (3200, None),
        (3200, 4.0),
        (3200, 5.6),
        (3200, None),
    ]
    assert k["old"]["value"] == pytest.approx(K_TRUE, rel=0.02)
    assert k["new"]["value"] == pytest.approx(k["old"]["value"] / 1.05, rel=1e-9)
    assert k["change"]["value"] == pytest.approx(100 * (1 / 1.05 - 1), rel=1e-9)
    assert k["difference"]["value"] == pytest.approx(k["new"]["value"] - k["old"]["value"])
    # one certificate, 1 % of each K: it cancels
    old, new, shared = k["old"], k["new"], 0.01
    assert found["meter_calibration"] == "common"
    variance = old["standard_uncertainty"] ** 2 + new["standard_uncertainty"] ** 2
    variance -= 2 * shared**2 * old["value"] * new["value"]
    assert k["in_standard_uncertainties"] == pytest.approx(
        abs(k["difference"]["value"]) / variance**0.5, rel=1e-9
    )
    assert (found["isos_gained"], found["isos_lost"]) == ([], [6400])
    assert {"flag": "meter_repeatability_estimated", "where": "iso 6400"} in found["flags_lost"]
    (touched,) = found["measurements"]
    assert touched["measurement_id"] == made["id"]
    assert touched["change"]["value"] == pytest.approx(5.0, abs=0.5)
    publish(house, second)
    back = impact(house, first)
    assert back["isos_gained"] == [6400]
    assert {"flag": "meter_repeatability_estimated", "where": "iso 6400"} in back["flags_gained"]


def test_a_meter_that_is_not_the_same_counts_in_both(house, staged):
    first = staged(make_metered_version)
    publish(house, first)
    campaign = {"id": first["campaign_id"]}
    for meter, said in (
        (None, "unknown"),
        ({"number": "D-K-2"}, "separate"),
        ({"serial": "other"}, "separate"),
    ):
        withdraw_readings(house, campaign)
        other = enter_meter(house, **meter) if meter else None
        add_readings(house, campaign, other, factor=1.05)
        found = impact(house, calibrate(house, campaign))
        assert found["meter_calibration"] == said
        k = next(row for row in found["coefficients"] if row["name"] == "luminance_k")
        u = (k["old"]["standard_uncertainty"] ** 2 + k["new"]["standard_uncertainty"] ** 2) ** 0.5
        assert k["difference"]["standard_uncertainty"] == pytest.approx(u)


def test_a_cameras_decisions_tell_who_did_what_when_and_why(house, pair):
    first, second = pair
    made = house.post("/v1/keys", {"name": "A. Meier", "scopes": ["read", "publish"]})
    publish(house, first)
    with house.with_key(made["secret"]) as reviewer:
        # the newer takes the later part of the older one's time, whose rest nobody published anew
        body = {"valid_from": MAY, "valid_to": "2027-05-10T00:00:00Z", "reason": "yearly"}
        assert reviewer.post(f"/v1/calibrations/{second['id']}/publish", json=body).status_code == 200
    house.revoke(first)
    items = house.get(f"/v1/cameras/{first['camera_id']}/decisions")["items"]
    assert [(each["act"], each["version"]) for each in items] == [
        ("revoked", 1),
        ("published", 2),
        ("published", 1),
        ("made", 2),
        ("made", 1),
    ]
    revoked, yearly, earlier, _, oldest = items
    assert (revoked["reason"], "valid_from" in revoked) == ("wrong lamp", False)
    assert (yearly["by"], yearly["by_name"], yearly["reason"]) == (made["id"], "A. Meier", "yearly")
    assert (yearly["valid_from"], yearly["valid_to"]) == (MAY, "2027-05-10T00:00:00Z")
    # as it was published, whatever became of it
    assert (earlier["valid_from"], "valid_to" in earlier) == (APRIL, False)
    assert (oldest["calibration_id"], "reason" in oldest) == (first["id"], False)

    # the same in both times: what each version held, now and before the last decision
    def list_held(known_at=None):
        query = {"method": "luminance"} | ({"known_at": known_at} if known_at else {})
        found = house.get(f"/v1/cameras/{first['camera_id']}/validity", **query)["items"]
        return {
            row["version"]: [[(p["valid_from"], p.get("valid_to")) for p in row[name]] for name in PERIODS]
            for row in found
        }

    held = [(APRIL, MAY), ("2027-05-10T00:00:00Z", None)]
    assert list_held() == {2: [[(MAY, "2027-05-10T00:00:00Z")], []], 1: [[], held]}
    assert list_held(yearly["at"]) == {2: [[(MAY, "2027-05-10T00:00:00Z")], []], 1: [held, []]}
    assert list_held(earlier["at"]) == {1: [[(APRIL, None)], []]}
    assert list_held(oldest["at"]) == {}
