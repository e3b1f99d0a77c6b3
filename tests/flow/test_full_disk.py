"""A disk that is full for a while: uploads are refused as such, all else waits and goes on by itself."""

import time
from contextlib import ExitStack

import httpx

from tests.support.compose import ROOT
from tests.support.deployments import Embedded
from tests.support.disks import filled, small_disk
from tests.support.processes import wait_until


def test_a_full_disk_refuses_uploads_and_ends_nothing(shots, tmp_path):
    with ExitStack() as stack:
        disk = stack.enter_context(small_disk(tmp_path, megabytes=96))
        # SQLite would follow the path out of the holder's namespace: it all runs inside.
        inside = ["nsenter", "--mount", "--target", disk.parts[2], f"--wdns={ROOT}"]
        deployment = stack.enter_context(Embedded(tmp_path / "data", wrapper=inside))
        with deployment.team() as team:
            campaign = team.campaign()
            upload = f"{team.url}/v1/campaigns/{campaign.id}/frames?role=light"
            headers = {"Authorization": f"Bearer {team.key}"}
            with deployment.stopped("worker"):
                frames = team.push(campaign, shots[:3])
                with filled(disk):
                    answers = [
                        httpx.post(upload, content=shot.path.read_bytes(), headers=headers, timeout=60.0)
                        for shot in shots[3:5]
                    ]
            with filled(disk):
                # Long enough for a part that is started again and again to be given up.
                time.sleep(6)
                answers.append(
                    httpx.post(upload, content=shots[5].path.read_bytes(), headers=headers, timeout=60.0)
                )
                assert httpx.get(f"{team.url}/livez").status_code == 200
            assert deployment.launcher.poll() is None
            assert {(answer.status_code, answer.json()["code"]) for answer in answers} == {
                (507, "storage_full")
            }
            assert all(answer.json()["retryable"] for answer in answers)
            wait_until(deployment.serves, "readiness once there is room", timeout_s=60)
            frames += team.push(campaign, shots[3:6])
            ended = [team.client.wait(frame.job_id) for frame in frames]
            assert [job.state for job in ended] == ["succeeded"] * 6
