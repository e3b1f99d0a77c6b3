"""Waiting for jobs: at once when they end, and in nobody's way until then."""

import asyncio
from pathlib import Path

import httpx
import pytest

from tests.support.deployments import wait_for

pytestmark = pytest.mark.either_database

WAITERS = 200


async def wait_with_many(team, job_id, meanwhile):
    limits = httpx.Limits(max_connections=None)
    async with httpx.AsyncClient(base_url=team.url, timeout=90.0, limits=limits) as http:
        headers = {"Authorization": f"Bearer {team.key}", "Prefer": "wait=60"}
        waiting = [
            asyncio.create_task(http.get(f"/v1/jobs/{job_id}", headers=headers)) for _ in range(WAITERS)
        ]
        await meanwhile(http, waiting)
        return await asyncio.gather(*waiting)


def test_many_who_wait_stand_in_nobodys_way(deployment, shots):
    with deployment.team() as team:
        campaign = team.campaign()
        with deployment.stopped("worker") as resume:
            (frame,) = team.push(campaign, shots[:1])
            sockets = Path(f"/proc/{deployment.pid('service')}/fd")
            key = {"Authorization": f"Bearer {team.key}"}

            async def meanwhile(http, waiting):
                await asyncio.to_thread(wait_for, lambda: len(list(sockets.iterdir())) >= WAITERS)
                for _ in range(20):
                    for path in ("/livez", "/readyz", "/v1/campaigns", f"/v1/frames/{frame.id}"):
                        answer = await http.get(path, headers=key)
                        assert answer.status_code == 200, (path, answer.text)
                upload = await http.post(
                    f"/v1/campaigns/{campaign.id}/frames?role=light",
                    content=shots[1].path.read_bytes(),
                    headers=key,
                )
                assert upload.status_code == 201
                assert not any(task.done() for task in waiting)
                resume()

            answers = asyncio.run(wait_with_many(team, frame.job_id, meanwhile))
        assert {answer.status_code for answer in answers} == {200}
        assert {answer.json()["state"] for answer in answers} == {"succeeded"}
        # Who had not been told of the end would have had it only when the time was over.
        assert max(answer.elapsed.total_seconds() for answer in answers) < 60


def test_who_waits_longer_than_asked_gets_the_job_as_it_is(deployment, shots):
    with deployment.team() as team, team.http() as http, deployment.stopped("worker"):
        (frame,) = team.push(team.campaign(), shots[:1])
        answer = http.get(f"/v1/jobs/{frame.job_id}", headers={"Prefer": "wait=1"})
        assert answer.status_code == 200
        assert answer.headers["Preference-Applied"] == "wait=1"
        assert answer.json()["state"] == "queued"
        assert answer.elapsed.total_seconds() >= 1


def test_a_job_that_has_ended_is_not_waited_for(deployment, shots):
    with deployment.team() as team, team.http() as http:
        (frame,) = team.push(team.campaign(), shots[:1])
        team.client.wait(frame.job_id)
        answer = http.get(f"/v1/jobs/{frame.job_id}", headers={"Prefer": "wait=60"})
        assert answer.json()["state"] == "succeeded"
        assert answer.elapsed.total_seconds() < 30
