"""Four who publish at once: never two versions in force, and a history that fits together."""

import itertools
import threading
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime, timedelta

from sqlalchemy import select

from store.tables import Publication

VERSIONS = 4
START = datetime(2026, 1, 1, tzinfo=UTC)


def make_versions(team, campaign):
    """Fits that differ in their tolerance only."""
    with team.http() as http:
        jobs = [
            http.post(f"/v1/campaigns/{campaign.id}/calibrations", json={"tolerance": 0.01 + number / 1000})
            for number in range(VERSIONS)
        ]
        results = [team.client.wait(job.json()["id"]).result for job in jobs]
    return [result["calibration_id"] for result in results]


def overlap(one, other):
    def meet(start, end, start_2, end_2):
        return (end_2 is None or start < end_2) and (end is None or start_2 < end)

    return meet(one.valid_from, one.valid_to, other.valid_from, other.valid_to) and meet(
        one.known_from, one.known_to, other.known_from, other.known_to
    )


def test_four_publish_at_once(deployment, shots_of_one_iso):
    with deployment.team() as team:
        campaign = team.campaign()
        frames = team.push(campaign, shots_of_one_iso)
        deployment.wait_for_jobs([frame.id for frame in frames])
        versions = make_versions(team, campaign)
        assert len(set(versions)) == VERSIONS
        at_once, ended = threading.Barrier(VERSIONS + 1), threading.Event()

        def publish(number):
            # Some reach into others, some end, some hold for good.
            valid_from = START + timedelta(days=number % 5)
            body = {"valid_from": valid_from.isoformat(), "reason": f"number {number}"}
            if number % 3 == 0:
                body["valid_to"] = (valid_from + timedelta(days=30)).isoformat()
            with team.http() as http:
                at_once.wait(60)
                # each waits for its certificate, of which two are set at a time
                path = f"/v1/calibrations/{versions[number]}/publish"
                return http.post(path, json=body, timeout=300.0)

        def watch():
            seen = []
            path = f"/v1/cameras/{campaign.camera_id}/coefficients"
            query = {"method": "luminance", "name": "luminance_k", "at": "2026-01-06T00:00:00Z"}
            with team.http() as http:
                at_once.wait(60)
                while not ended.is_set():
                    answer = http.get(path, params=query)
                    rows = answer.json().get("items", [])
                    seen.append((answer.status_code, len({row["calibration_id"] for row in rows})))
            return seen

        with ThreadPoolExecutor(VERSIONS + 1) as pool:
            watching = pool.submit(watch)
            try:
                answers = list(pool.map(publish, range(VERSIONS)))
            finally:
                ended.set()
        assert [answer.status_code for answer in answers] == [200] * VERSIONS
        assert {(200, 1)} <= set(watching.result()) <= {(404, 0), (200, 1)}
        with deployment.database.reading() as session:
            rows = list(session.scalars(select(Publication).where(Publication.calibration_id.in_(versions))))
        assert {row.calibration_id for row in rows} == set(versions)
        assert not [pair for pair in itertools.combinations(rows, 2) if overlap(*pair)]
        check_history(team, campaign, rows)


def check_history(team, campaign, rows):
    """At every time at which something became known, what was published last for that day is in force."""
    day = START + timedelta(days=5)
    first = {}
    for row in sorted(rows, key=lambda row: row.known_from):
        first.setdefault(row.calibration_id, row)
    for published in first.values():
        if published.valid_from <= day and (published.valid_to is None or published.valid_to > day):
            found = team.client.coefficients(campaign.camera_id, at=day, known_at=published.known_from)
            assert {row.calibration_id for row in found} == {published.calibration_id}
    with_state = [c.state for c in team.client.history(campaign.camera_id)]
    assert set(with_state) <= {"published", "superseded"}
    assert "published" in with_state
