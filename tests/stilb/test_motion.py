"""The command that shows how far the picture moved during each frame."""

import pytest

from stilb.commands.output import Exit

ROW = {"frame_id": "frm_1", "filename": "1.TIF", "role": "field"}
MOVED = ROW | {
    "rotation_rate_deg_s": 10.0,
    "rotation_blur_px": 1.852,
    "theoretical_blur_px": 1.852,
    "within_limit": False,
}
UNKNOWN = ROW | {"missing_code": "attitude_missing", "missing": "no [two] records"}
CAMPAIGN = {"id": "cmp_1", "camera_id": "cam_1", "method": "reflectance"}


@pytest.fixture
def ask(service, stilb_command, monkeypatch):
    """The command's end where the service answers with these rows."""
    monkeypatch.setenv("STILB_URL", service.url)
    monkeypatch.setenv("STILB_KEY", "the-key")

    def run(rows, *options):
        within = [row.get("within_limit") for row in rows]
        counts = {"frames": len(rows), "with_rates": sum(each is not None for each in within)}
        counts |= {"within_limit": within.count(True), "beyond_limit": within.count(False)}
        used = {"pixel_pitch_um": 3.75, "focal_length_mm": 3.98, "limit_px": 0.5}
        service.will_answer(CAMPAIGN)
        service.will_answer(counts | used | {"rows": rows})
        return stilb_command("motion", "cmp_1", *options)

    return run


def test_what_was_asked_is_asked_of_the_service(service, ask):
    options = ("--focal-length", 3.98, "--limit", 2, "--speed", 6, "--height", 100, "--role", "field")
    ended = ask([MOVED | {"within_limit": True}], *options, "--json")
    assert (ended.code, ended.json["rows"][0]["rotation_blur_px"]) == (Exit.DONE, 1.852)
    asked = service.asked[1]
    assert asked.path == "/v1/campaigns/cmp_1/motion"
    said = {"focal_length_mm": 3.98, "limit_px": 2, "ground_speed_m_s": 6, "distance_m": 100}
    assert {name: float(asked.query[name]) for name in said} == said
    assert asked.query["role"] == "field"
    assert "pixel_pitch_um" not in asked.query


def test_a_frame_beyond_the_limit_is_a_finding_and_a_reason_is_given_once(ask):
    rows = [UNKNOWN | {"filename": "2.TIF"}, MOVED, UNKNOWN | {"filename": "3.TIF"}]
    ended = ask(rows, "--focal-length", 3.98)
    assert ended.code == Exit.FINDINGS
    assert "BEYOND" in ended.out
    assert "2.TIF and 1 more: no [two] records" in ended.out
    assert "3 frames, 1 with rates: 0 within 0.5 px, 1 beyond" in ended.out
    missing = ask([])
    assert (missing.code, "--focal-length" in missing.err) == (Exit.USAGE, True)
