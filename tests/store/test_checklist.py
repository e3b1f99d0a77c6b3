"""What the record ticks of a real campaign, what people tick, and when."""

import pytest

from store.queries.checklist import BY_ITSELF, read_checklist, read_signature, set_tick, sign
from store.reviews import assess
from store.tables import Campaign, utc_now
from tests.support.campaigns import calibrate, upload_campaign

pytestmark = pytest.mark.either_database

FROM_THE_VERSION = {
    *("dark_median", "calibration_dark_subtracted", "calibration_rhs", "calibration_plot"),
    "calibration_regression",
}
FROM_THE_FRAMES = {
    *("scenes_levels", "scenes_luminance_readings", "settings_exposure_manual", "settings_format_dng"),
    *("shooting_iso_and_apertures", "shooting_every_combination", "shooting_settings_recorded"),
    *("extract_polygon", "extract_coordinates", "extract_to_tiff", "extract_imagej_open"),
    *("extract_first_image", "extract_script_filled", "extract_script_run", "extract_results_saved"),
    *("dark_frames", "dark_extracted"),
}


def read(house, campaign):
    with house.database.reading() as session:
        row = session.get_one(Campaign, campaign["id"])
        items = read_checklist(session, row, assess(session, row).record)
    return {item.key: item for item in items}


def tick(house, campaign, key, *, by="key_9", done=True, note=None):
    with house.database.writing(by) as session:
        set_tick(session, session.get_one(Campaign, campaign["id"]), key, done=done, note=note, by=by)
    return read(house, campaign)[key]


def done(items):
    return {key for key, item in items.items() if item.done_by}


def test_the_record_ticks_what_it_proves_and_nothing_else_and_a_person_stands_before_it(house):
    before = utc_now()
    campaign = upload_campaign(house, isos=(3200,))
    assert done(read(house, campaign)) == {"extract_polygon", "extract_coordinates"}
    house.work()
    assert done(read(house, campaign)) == FROM_THE_FRAMES
    version = calibrate(house, campaign)
    items = read(house, campaign)
    assert done(items) == FROM_THE_FRAMES | FROM_THE_VERSION
    for key in done(items):
        assert items[key].done_by == BY_ITSELF
        assert before <= items[key].done_at <= utc_now()
    k = version["coefficients"][0]
    assert f"ISO 3200: K = {k['value']:.6g} DN*m2/(cd*s)" in items["calibration_regression"].evidence
    assert "the median of 3 frames" in items["dark_median"].evidence
    assert f"Version {version['version']}: signal against RHS" in items["calibration_plot"].evidence
    assert items["general_recorder"].missing == "Not recorded."
    item = tick(house, campaign, "settings_format_dng", done=False, note="two were renamed")
    assert (item.done_by, item.done_at, item.note) == (None, None, "two were renamed")
    assert item.evidence.startswith("Every light and dark frame is a raw DNG: 15 frames (")
    item = tick(house, campaign, "settings_format_dng")
    assert (item.done_by, item.note) == ("key_9", "two were renamed")


def test_what_is_written_on_the_campaign_is_dated_by_the_audit_trail(house):
    campaign = house.campaign(project_number="P-17")
    between = utc_now()
    answer = house.http.patch(f"/v1/campaigns/{campaign['id']}", json={"recorder": "B. Schulz"})
    assert answer.status_code == 200
    items = read(house, campaign)
    assert items["general_project_number"].done_at < between < items["general_recorder"].done_at
    assert items["general_recorder"].evidence == "B. Schulz."
    assert items["general_date"].done_by is None


def test_a_tick_keeps_who_did_it_first_and_when_and_the_last_signature_stands(house):
    campaign = house.campaign()
    first = tick(house, campaign, "equipment_lamp", by="key_1")
    assert tick(house, campaign, "equipment_lamp", by="key_2") == first
    assert first.done_by == "key_1"
    with house.database.writing("key_9") as session:
        row = session.get_one(Campaign, campaign["id"])
        for name in ("A. Meier", "B. Schulz"):
            sign(session, row, name=name, by="key_9")
            session.flush()
        signature = read_signature(session, row)
    assert (signature.name, signature.signed_by) == ("B. Schulz", "key_9")
