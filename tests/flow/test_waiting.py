"""Waiting for jobs: at once when they end, and in nobody's way until then."""

import asyncio
from pathlib import Path

import httpx

from tests.support.waiting import wait_for

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


def test_many_who_wait_stand_in_nobodys_way(embedded, shots):
    with embedded.team() as team:
        campaign = team.campaign()
        with embedded.stopped("worker") as resume:
            (frame,) = team.push(campaign, shots[:1])
            sockets = Path(f"/proc/{embedded.pid('service')}/fd")
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
        with team.http() as http:
            ended = http.get(f"/v1/jobs/{frame.job_id}", headers={"Prefer": "wait=60"})
        assert ended.elapsed.total_seconds() < 30
