"""Which frame of a capture is asked for: read, not refused, and of two the older."""

import pytest

from radiometry.findings import InputRejected, shared
from store.measuring.plan import Captures
from store.tables import FrameRow

pytestmark = pytest.mark.either_database

CAPTURE = {"system": "sequoia", "band_name": "", "capture_id": "C-1"}


@pytest.fixture
def taken(house):
    """The ids of three read frames: near infrared, and two that both say that they are red."""
    campaign = house.campaign()
    ids = [house.upload(campaign, house.frame_bytes(seed=seed), role="field")["id"] for seed in (1, 2, 3)]
    house.work()
    with house.database.writing("test") as session:
        for frame_id, band in zip(ids, ("nir", "red", "red"), strict=True):
            row = session.get_one(FrameRow, frame_id)
            row.header = {**row.header, "multispectral": {**CAPTURE, "band": band}}
    return ids


def find(house, frame_id, band="red"):
    with house.database.reading() as session:
        return Captures(session).find(session.get_one(FrameRow, frame_id), band).id


def test_of_two_frames_of_a_band_the_older_counts(house, taken):
    nir, older, later = taken
    assert older < later
    assert find(house, nir) == older
    assert find(house, later) == later
    assert find(house, older, "nir") == nir


def test_a_refused_frame_is_no_band(house, taken):
    nir, older, later = taken
    with house.database.writing("test") as session:
        row = session.get_one(FrameRow, older)
        row.state, row.refusal_code, row.refusal_detail = "refused", "truncated", "It is cut."
    assert find(house, nir) == later
    with pytest.raises(InputRejected) as refused:
        find(house, nir, "green")
    assert refused.value.code == shared.CAPTURE_INCOMPLETE
