"""What becomes of a job: stored once, refused, tried later, failed with its traceback kept."""

import logging
import threading
from contextlib import nullcontext
from dataclasses import replace

import pytest
from sqlalchemy import func, select

from store.blobs import StorageUnavailable
from store.sandbox import Sandbox
from store.tables import ChannelRow, Extraction, FrameRow, Job
from tests.support.blobs import zero
from tests.support.campaigns import ROI
from worker.decode.pool import DecoderCrashed, DecoderKilled, DecoderUnavailable
from worker.process import start_decoders
from worker.runner import run

pytestmark = pytest.mark.either_database


class Decoders:
    """Stands in for the pool: raises what a file can make it raise."""

    def __init__(self, error):
        self.error = error

    def hold(self, _path):
        return nullcontext()

    def read_header(self, _path):
        raise self.error


@pytest.fixture
def uploaded(house):
    """A campaign with a region and one frame that waits."""
    campaign = house.campaign()
    house.http.put(f"/v1/campaigns/{campaign['id']}/roi", json=ROI)
    return house.upload(campaign, house.frame_bytes(), role="light", scene="level-1")


def job(house, frame):
    return house.get(f"/v1/jobs/{frame['job_id']}")


def work(house, decoders=None):
    """Do the one job that is due, where a file makes its decoder raise an error."""
    if isinstance(decoders, Exception):
        decoders = Decoders(decoders)
    context = replace(house.worker, decoders=decoders) if decoders else house.worker
    return run(context, house.next_job())


def test_ten_who_look_for_the_same_job_at_once_do_it_once(house, uploaded):
    threads = [threading.Thread(target=house.work) for _ in range(10)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert (job(house, uploaded)["state"], job(house, uploaded)["attempt"]) == ("succeeded", 1)
    with house.database.reading() as session:
        assert session.scalar(select(func.count()).select_from(Extraction)) == 1
        assert session.scalar(select(func.count()).select_from(ChannelRow)) == 5


def test_a_file_that_ends_the_decoder_is_refused_and_the_next_is_not_disturbed(house, uploaded):
    work(house, DecoderCrashed("reading the header", "signal 11"))
    assert job(house, uploaded)["error"]["code"] == "decoder_crashed"
    frame = house.get(f"/v1/frames/{uploaded['id']}")
    assert (frame["state"], frame["refusal"]["code"]) == ("refused", "decoder_crashed")
    again = house.upload({"id": uploaded["campaign_id"]}, house.frame_bytes(seed=2), role="dark")
    work(house)
    assert house.get(f"/v1/frames/{again['id']}")["state"] == "extracted"


def test_a_decoder_that_ends_over_a_file_which_the_disk_spoilt_blames_the_disk(house, uploaded):
    """A mapped page that cannot be read ends a process by SIGBUS, as a hostile file may."""
    zero(house.folder, uploaded["sha256"], first=900, count=2000)
    work(house, DecoderCrashed("reading a window", "signal 7"))
    assert job(house, uploaded)["error"]["code"] == "stored_file_damaged"
    assert house.get(f"/v1/frames/{uploaded['id']}")["state"] == "received"


def test_a_frame_whose_decoder_was_killed_is_never_refused(house, uploaded):
    killed = DecoderKilled("read_header", "ended by SIGKILL")
    work(house, killed)
    assert (job(house, uploaded)["state"], job(house, uploaded)["error"]["retryable"]) == ("queued", True)
    with house.database.writing("test") as session:
        waiting = session.get_one(Job, uploaded["job_id"])
        waiting.attempt, waiting.due_at = 4, waiting.created_at
    work(house, killed)
    found, error = job(house, uploaded), job(house, uploaded)["error"]
    assert (found["state"], error["code"], error["retryable"]) == ("failed", "decoder_crashed", True)
    assert house.get(f"/v1/frames/{uploaded['id']}")["state"] == "received"


def test_a_passing_fault_is_tried_again(house, uploaded):
    ended = work(house, StorageUnavailable("away"))
    assert (ended["state"], ended["waits_for"]) == ("queued", "blobs")
    found = job(house, uploaded)
    assert (found["state"], found["error"]["retryable"]) == ("queued", True)
    assert house.get(f"/v1/frames/{uploaded['id']}")["state"] == "received"


def test_our_own_fault_fails_with_its_traceback_kept_and_not_shown(house, uploaded):
    work(house, ZeroDivisionError("ours"))
    found = job(house, uploaded)
    assert (found["state"], found["error"]["code"]) == ("failed", "internal_error")
    assert "ZeroDivisionError" not in str(found)
    house.upload({"id": uploaded["campaign_id"]}, house.frame_bytes(), status=200, role="light")
    work(house)
    assert house.get(f"/v1/frames/{uploaded['id']}")["state"] == "extracted"
    with house.database.reading() as session:
        assert "ZeroDivisionError: ours" in session.get_one(Job, uploaded["job_id"]).traceback


def test_a_worker_whose_job_was_given_away_stores_nothing(house, uploaded):
    class Slow(Decoders):
        def read_header(self, path):
            with house.database.writing("test") as session:
                session.get_one(Job, uploaded["job_id"]).fence += 1
            return house.worker.decoders.read_header(path)

        def __getattr__(self, name):
            return getattr(house.worker.decoders, name)

    assert work(house, Slow(None)) == {"state": "dropped"}
    with house.database.reading() as session:
        assert session.get_one(FrameRow, uploaded["id"]).state == "received"
        assert session.scalar(select(func.count()).select_from(Extraction)) == 0


FULL = Sandbox(no_new_privs=True, landlock=7, seccomp=True)
OLD_KERNEL = Sandbox(no_new_privs=True, landlock=0, seccomp=True)


class Starting:
    def __init__(self, sandbox):
        self.sandbox = sandbox

    def start(self):
        return self.sandbox


def test_require_refuses_a_kernel_that_lacks_a_part_and_names_it():
    with pytest.raises(DecoderUnavailable, match=r"require.*no landlock_files"):
        start_decoders(Starting(OLD_KERNEL), require=True)
    assert start_decoders(Starting(FULL), require=True)["level"] == "full"


def test_auto_works_with_less_and_says_what_is_missing(caplog):
    with caplog.at_level(logging.INFO):
        told = start_decoders(Starting(OLD_KERNEL), require=False)
    assert (told["level"], told["landlock_files"], told["seccomp"]) == ("seccomp only", False, True)
    assert "decoder sandbox: seccomp only (no_new_privs, seccomp)" in caplog.messages
    assert any("no landlock_files" in line for line in caplog.messages)
