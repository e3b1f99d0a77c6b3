"""What the service tells those who watch it."""

import shutil
from datetime import timedelta

import pytest
from sqlalchemy import update

from store.clocks import mend_times
from store.columns import utc_now
from store.software import CODE_VERSION
from store.tables import Job


def test_metrics_count_what_the_database_holds(house):
    campaign = house.campaign()
    house.upload(campaign, b"no raw file", role="light")
    lines = house.http.get("/metrics").text.splitlines()
    assert 'stilb_jobs{state="queued"} 1' in lines
    assert 'stilb_frames{state="received"} 1' in lines
    age = next(line for line in lines if line.startswith("stilb_oldest_queued_job_age_seconds "))
    assert float(age.split()[1]) > 0
    assert "stilb_jobs_due_later 0" in lines
    with house.database.writing("test") as session:
        later = utc_now() + timedelta(hours=1)
        session.execute(update(Job).values(due_at=later))
    lines = house.http.get("/metrics").text.splitlines()
    assert "stilb_jobs_due_later 1" in lines
    assert "stilb_oldest_queued_job_age_seconds 0.000" in lines
    with house.database.writing("test") as session:
        mend_times(session, lease_s=30.0, jumped=False)
    assert "stilb_jobs_due_later 0" in house.http.get("/metrics").text.splitlines()
    house.work()
    lines = house.http.get("/metrics").text.splitlines()
    assert 'stilb_jobs{state="failed"} 1' in lines
    assert 'stilb_frames{state="refused"} 1' in lines
    assert 'stilb_refusals{code="not_a_raw_file"} 1' in lines
    assert "stilb_uploads 1" in lines
    assert "stilb_oldest_queued_job_age_seconds 0.000" in lines
    assert "stilb_versions_published 0" in lines


def test_metrics_tell_the_version_and_the_room_on_the_disk(house):
    lines = house.http.get("/metrics").text.splitlines()
    assert f'stilb_info{{version="{CODE_VERSION}"}} 1' in lines
    (free,) = [line for line in lines if line.startswith("stilb_data_free_bytes ")]
    assert int(free.split()[1]) == pytest.approx(shutil.disk_usage(house.folder).free, rel=0.2)
