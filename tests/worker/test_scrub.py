"""Stored files are proven by themselves, slowly, and what is found is kept."""

from datetime import timedelta

import pytest
from sqlalchemy import select

from store.files import Files, count_damaged, find_proof_age_s
from store.tables import Blob, FrameRow, Job, utc_now
from tests.support.blobs import spoil, zero
from verify.audit import main as check_audit
from worker.background import Scrub

pytestmark = pytest.mark.either_database


@pytest.fixture
def frames(house):
    """Two, of which the first has not been proven for 31 days."""
    campaign = house.campaign()
    sent = [house.upload(campaign, house.frame_bytes(seed=seed), role="dark") for seed in (1, 2)]
    with house.database.writing("test") as session:
        session.get_one(Blob, sent[0]["sha256"]).proven_at = utc_now() - timedelta(days=31)
    return sent


def make_scrub(house, waits=None):
    files = Files(house.database, house.blobs)
    return Scrub(house.database, files, wait=(waits if waits is not None else []).append)


def blob(house, sha256):
    with house.database.reading() as session:
        return session.get_one(Blob, sha256)


def test_what_was_not_proven_for_long_is_proven_at_its_pace(house, frames):
    waits = []
    with house.database.reading() as session:
        assert find_proof_age_s(session) > 30 * 86_400
    make_scrub(house, waits).do_round()
    with house.database.reading() as session:
        assert find_proof_age_s(session) < 600
        assert count_damaged(session) == {}
    assert sum(waits) == pytest.approx(frames[0]["size_bytes"] / 20e6), "the other one is not due"


def test_damage_is_found_and_a_file_that_was_brought_back_is_whole_again(house, frames, monkeypatch, capsys):
    sha256 = frames[0]["sha256"]
    content = house.frame_bytes(seed=1)
    zero(house.folder, sha256, first=900, count=2000)
    make_scrub(house).do_round()
    assert blob(house, sha256).damage == "damaged"
    monkeypatch.setenv("STILB_DATABASE_URL", house.database.url.render_as_string(hide_password=False))
    assert check_audit([]) == 1
    assert "stored files that are damaged: 1" in capsys.readouterr().err
    spoil(house.blobs, house.folder, sha256, content)
    make_scrub(house).do_round()
    assert blob(house, sha256).damage is None
    assert check_audit([]) == 0


def test_a_file_of_an_older_stilb_gets_its_digests(house, frames):
    sha256 = frames[1]["sha256"]
    with house.database.writing("test") as session:
        row = session.get_one(Blob, sha256)
        digests, row.digests = row.digests, None
    make_scrub(house).do_round()
    with house.database.reading() as session:
        assert session.scalar(select(Blob.digests).where(Blob.sha256 == sha256)) == digests


def test_a_lost_preview_is_drawn_again_by_itself(house, frames):
    house.work()
    with house.database.reading() as session:
        preview = session.get_one(FrameRow, frames[0]["id"]).preview_sha256
    spoil(house.blobs, house.folder, preview, None)
    with house.database.writing("test") as session:
        session.get_one(Blob, preview).proven_at = utc_now() - timedelta(days=31)
    make_scrub(house).do_round()
    assert blob(house, preview).damage == "missing"
    with house.database.reading() as session:
        waiting = session.scalars(select(Job.subject_id).where(Job.state == "queued")).all()
    assert waiting == [frames[0]["id"]]
    house.work()
    assert blob(house, preview).damage is None
    assert house.http.get(f"/v1/frames/{frames[0]['id']}/preview.png").status_code == 200
