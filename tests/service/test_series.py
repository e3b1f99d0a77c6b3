"""Series: the same rows in every form and in pages of every size."""

import base64
import csv
import io
import json

import pytest
from sqlalchemy import delete, select

from service.coefficients import series as answers
from service.coefficients.series import MeasurementSeriesRow, SeriesRow
from store.ready import series as coefficient_series
from store.ready import series as measurement_series
from store.ready.rows import write_missing
from store.tables import MeasuredRow
from tests.support.campaigns import published_campaign
from tests.support.measuring import field_frame, measure

pytestmark = pytest.mark.either_database

COEFFICIENTS, MEASUREMENTS = "/v1/series/coefficients", "/v1/series/measurements"


@pytest.fixture
def measured(house, staged):
    """A version that is in force twice, with a gap, and two measurements with it."""
    version = staged(published_campaign, isos=(3200,))
    house.publish(version, valid_from="2027-05-01T00:00:00Z", valid_to="2027-06-01T00:00:00Z")
    frames = [field_frame(house, version["campaign_id"], seed=seed) for seed in (1, 2)]
    return version, [measure(house, frame, version) for frame in frames]


def read_all(house, address, **query):
    rows, taken = [], 0
    answer = house.get(address, **query)
    while True:
        rows += answer["rows"]
        taken += 1
        if "next" not in answer:
            return rows, taken
        answer = house.get(answer["next"])


@pytest.mark.parametrize(
    ("address", "row"), [(COEFFICIENTS, SeriesRow), (MEASUREMENTS, MeasurementSeriesRow)]
)
def test_every_form_and_every_page_has_the_same_rows(house, measured, address, row, monkeypatch):
    rows = house.get(address)["rows"]
    version, _ = measured
    assert len(rows) == (3 * len(version["coefficients"]) if address == COEFFICIENTS else 2)
    assert {tuple(each) for each in rows} == {tuple(row.model_fields)}
    text = house.http.get(address, headers={"Accept": "text/csv"}).text
    lines = list(csv.DictReader(io.StringIO(text)))
    assert [[*line] for line in lines] == [[*each] for each in rows]
    for line, each in zip(lines, rows, strict=True):
        assert list(line.values()) == ["" if cell is None else str(cell) for cell in each.values()]
    for limit in (1, 5):
        assert read_all(house, address, limit=limit) == (rows, -(-len(rows) // limit))
    of_camera = read_all(house, address, limit=2, camera_id=version["camera_id"])
    assert of_camera[0] == [row for row in rows if row["camera_id"] == version["camera_id"]] != []
    for each in (coefficient_series, measurement_series):
        monkeypatch.setattr(each, "PAGE", 2)
    monkeypatch.setattr(coefficient_series, "_VERSIONS", 1)
    monkeypatch.setattr(answers, "ROW_LIMIT", 1)
    assert read_all(house, address, limit=100) == (rows, 1)
    assert read_all(house, address, limit=5)[0] == rows
    cut = house.http.get(address, params={"format": "csv"})
    assert len(list(csv.DictReader(io.StringIO(cut.text)))) == 1
    assert 'rel="next"' in cut.headers["Link"]


@pytest.mark.parametrize(
    ("address", "first", "last"),
    [
        (COEFFICIENTS, "from", "to"),
        (MEASUREMENTS, "from", "to"),
        (MEASUREMENTS, "computed_from", "computed_to"),
        ("/v1/audit", "from", "to"),
        ("/v1/audit/entries.csv", "from", "to"),
    ],
)
def test_times_that_are_turned_round_are_refused(house, address, first, last):
    turned = {first: "2026-05-02T00:00:00Z", last: "2026-05-01T00:00:00Z"}
    answer = house.http.get(address, params=turned)
    assert (answer.status_code, answer.json()["code"]) == (422, "validation_failed")
    assert f"{first} is later than {last}" in answer.json()["detail"]
    assert house.http.get(address, params=dict.fromkeys(turned, turned[last])).status_code == 200


def test_series_is_sent_again_only_after_what_changes_it(house, measured):
    version, _ = measured
    tags = {}
    for address in (COEFFICIENTS, MEASUREMENTS):
        packed = house.http.get(address, headers={"Accept-Encoding": "gzip"})
        plain = house.http.get(address, headers={"Accept-Encoding": "identity"})
        assert (packed.headers["Content-Encoding"], packed.json()) == ("gzip", plain.json())
        refused = house.http.get(address, headers={"Accept-Encoding": "gzip;q=0, br"})
        assert "Content-Encoding" not in refused.headers
        assert refused.headers["ETag"] == plain.headers["ETag"] == packed.headers["ETag"].replace(".gz", "")
        tag = {"If-None-Match": packed.headers["ETag"], "Accept-Encoding": "identity"}
        assert house.http.get(address, headers=tag).status_code == 304
        assert house.http.get(address, params={"limit": 1}, headers=tag).status_code == 200
        tags[address] = tag
    house.post("/v1/campaigns", {"camera_id": version["camera_id"], "method": "noise"})
    assert all(house.http.get(at, headers=tag).status_code == 304 for at, tag in tags.items())
    house.patch(f"/v1/cameras/{version['camera_id']}", {"serial": "corrected"})
    for address, tag in tags.items():
        answer = house.http.get(address, headers=tag)
        assert {row["serial"] for row in answer.json()["rows"]} == {"corrected"}
    house.revoke(version)
    assert house.http.get(MEASUREMENTS, headers=tag).status_code == 200
    assert house.get(COEFFICIENTS)["rows"] == []
    rows = house.get(MEASUREMENTS)["rows"]
    assert {row["calibration_state"] for row in rows} == {"revoked"}
    assert all("calibration_revoked" in row["flags"].split() for row in rows)


def test_measurements_are_chosen_by_when_their_frame_was_taken(house, measured):
    version, answers_ = measured
    rows = house.get(MEASUREMENTS)["rows"]
    assert {row["id"]: row["mean_cd_m2"] for row in rows} == {
        each["id"]: each["mean"]["value"] for each in answers_
    }
    assert {(row["camera_id"], row["campaign_id"]) for row in rows} == {
        (version["camera_id"], version["campaign_id"])
    }
    taken, computed = rows[0]["taken_at"], rows[0]["created_at"]
    assert "2026-04-30" < taken < "2026-05-03" < computed

    def count(**query):
        return len(house.get(MEASUREMENTS, **query)["rows"])

    april, june = "2026-04-01T00:00:00Z", "2026-06-01T00:00:00Z"
    assert (count(**{"from": april, "to": june}), count(**{"from": june}), count(to=april)) == (2, 0, 0)
    assert (count(computed_from=computed), count(computed_to=computed)) == (2, 0)
    assert (count(method="luminance"), count(method="noise"), count(campaign_id="other")) == (2, 0, 0)


@pytest.mark.usefixtures("measured")
def test_rows_of_measurements_are_written_for_what_was_measured_before(house):
    with house.database.writing("test") as session:
        rows = session.execute(select(MeasuredRow.__table__)).all()
        session.execute(delete(MeasuredRow))
        write_missing(session)
        assert session.execute(select(MeasuredRow.__table__)).all() == rows
    assert len(rows) == 2


@pytest.mark.parametrize("key", [[], ["a", "b"], [1, 2], ["2026-01-01", "a\0"], {"a": 1}, "x", None])
def test_forged_cursor_is_refused(sqlite_house, key):
    cursor = base64.urlsafe_b64encode(json.dumps(key).encode()).decode().rstrip("=")
    for address in (COEFFICIENTS, MEASUREMENTS):
        problem = sqlite_house.get(address, status=422, cursor=cursor)
        assert problem["errors"][0]["field"] == "query.cursor"
