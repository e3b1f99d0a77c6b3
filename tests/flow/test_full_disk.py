"""A disk that is full for a while: uploads are refused as such, all else waits and goes on by itself."""

import re
import signal
import time

import pytest

from service.up import ROSTER
from tests.support.blobs import files
from tests.support.deployments import Embedded, short_folder
from tests.support.disks import filled, small_disk
from tests.support.processes import alive, children, command, family, wait_until
from tests.support.waiting import status_of, wait_for

# Long enough for a part that is started again and again to be given up.
FULL_S = 6.0
MEGABYTE = 1 << 20


@pytest.fixture(scope="module")
def deployment():
    """`make up` on a small disk."""
    with short_folder() as folder, small_disk(folder), Embedded(folder / "data") as deployment:
        yield deployment


def refusal(answer):
    problem = answer.json()
    return answer.status_code, problem["code"], problem["retryable"]


def frames_path(campaign):
    return f"/v1/campaigns/{campaign.id}/frames?role=light"


def test_a_full_disk_refuses_uploads_and_ends_nothing(deployment, shots):
    with deployment.team() as team, team.http() as http:
        campaign = team.campaign()

        def post(shot):
            return http.post(frames_path(campaign), content=shot.path.read_bytes())

        with deployment.stopped("worker"):
            frames = team.push(campaign, shots[:3])
            with filled(deployment.data):
                answers = [post(shot) for shot in shots[3:5]]
        with filled(deployment.data):
            time.sleep(FULL_S)
            answers.append(post(shots[5]))
            assert status_of(f"{team.url}/livez") == 200
        assert deployment.launcher.poll() is None
        assert {refusal(answer) for answer in answers} == {(507, "storage_full", True)}
        wait_until(deployment.serves, "readiness once there is room", timeout_s=60)
        frames += team.push(campaign, shots[3:6])
        ended = [team.client.wait(frame.job_id) for frame in frames]
        assert [job.state for job in ended] == ["succeeded"] * 6


def test_what_fits_is_taken_and_what_does_not_leaves_nothing_behind(deployment, shots):
    with deployment.team() as team, team.http() as http:
        campaign = team.campaign()
        before = files(deployment.blobs)
        with filled(deployment.data, but_bytes=4 * MEGABYTE):
            large = http.post(frames_path(campaign), content=b"x" * 8 * MEGABYTE)
            assert refusal(large) == (507, "storage_full", True)
            assert files(deployment.blobs) == before
            assert http.get(f"/v1/campaigns/{campaign.id}/frames").json()["items"] == []
            (small,) = team.push(campaign, shots[:1])
            team.client.wait(small.job_id, timeout_s=60)
        assert http.post(frames_path(campaign), content=b"x" * 8 * MEGABYTE).status_code == 201


def test_a_stop_ends_all_in_order(deployment, shots):
    with deployment.team() as team:
        frames = team.push(team.campaign(), shots[6:10])
        deployment.wait_for_jobs([frame.id for frame in frames])
    tree = family(deployment.launcher.pid)
    assert [pid for pid in tree if "worker.decode" in command(pid)]
    assert len(children(deployment.launcher.pid)) == 1 + len(ROSTER.parts)
    deployment.launcher.send_signal(signal.SIGTERM)
    out, err = deployment.launcher.communicate(timeout=60)
    # it says where a slow machine lets it wait
    said = re.sub("stilb: waiting for .*\n", "", err)
    assert (deployment.launcher.returncode, out, said) == (0, "", "")
    wait_for(lambda: not alive(tree))
