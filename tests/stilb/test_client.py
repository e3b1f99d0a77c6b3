"""Each method asks the route that the contract names, and reads the answer that the contract describes."""

from datetime import UTC, date, datetime

import numpy as np
import pytest

import stilb
from stilb.export import frame_path
from stilb.field.files import plain_stem
from stilb.records import as_text

K = {"name": "luminance_k", "value": 33.1, "standard_uncertainty": 0.2, "iso": 3200, "unit": "DN*m2/(cd*s)"}
CALIBRATION = {
    "id": "k-1",
    "method": "luminance",
    "state": "draft",
    "version": 1,
    "camera_id": "cam-1",
    "valid_from": None,
    "coefficients": [K],
    "diagnostics": {"verdict": "pass"},
}
JOB = {"id": "j-1", "kind": "fit", "state": "queued", "progress": 0.0, "attempt": 0}


def job(state, **more):
    return {**JOB, "state": state, **more}


def test_a_camera_with_its_lens(service, client):
    named, lens = {"make": "DJI", "model": "X5S", "serial": "S1", "note": "n"}, {"model": "15 mm"}
    service.will_answer({"id": "cam-1"} | named, status=201)
    camera = client.create_camera(**named, lens=lens)
    assert service.asked[0].json["lens"] == lens
    assert (camera.id, camera.raw["note"]) == ("cam-1", "n")


def test_a_job_is_waited_for(service, client):
    service.will_answer(job("running", progress=0.5))
    service.will_answer(job("succeeded", progress=1.0, result={"calibration_id": "k-1"}))
    done = client.wait("j-1")
    assert done.result == {"calibration_id": "k-1"}
    assert service.asked[0].headers["prefer"] == "wait=30"


def test_a_failed_job_raises_its_problem(service, client):
    error = {"status": 422, "code": "fit_incomplete", "detail": "too few scenes", "retryable": False}
    service.will_answer(job("failed", error=error))
    with pytest.raises(stilb.JobFailed, match="fit_incomplete: too few scenes") as found:
        client.wait(stilb.Job.of(JOB))
    assert (found.value.job.id, found.value.status) == ("j-1", 422)
    service.will_answer(job("quarantined"))
    with pytest.raises(stilb.JobFailed, match="quarantined"):
        client.wait("j-1")


def campaign_with(being_read):
    return {"id": "c-1", "camera_id": "cam-1", "method": "luminance", "frames": {"being_read": being_read}}


def test_calibrate_waits_for_frames_that_are_read_again_and_reads_the_draft(service, monkeypatch):
    monkeypatch.setattr("time.sleep", lambda _s: None)
    detail = "69 of 81 frames are read again"
    again = {"code": "campaign_incomplete", "status": 422, "detail": detail, "retryable": True}
    for answer in (campaign_with(0), (again, 422), campaign_with(69), campaign_with(0), (JOB, 202)):
        body, status = answer if isinstance(answer, tuple) else (answer, 200)
        service.will_answer(body, status=status)
    service.will_answer(job("succeeded", result={"calibration_id": "k-1"}))
    service.will_answer(CALIBRATION)
    told = []
    given = {"model": "proportional", "tolerance": 0.04}
    with stilb.Client(service.url, "key", retries=0) as client:
        calibration = client.calibrate("c-1", **given, on_progress=lambda *counts: told.append(counts))
    assert told == [(0, 69), (69, 69)]
    tried, *_, begun, _, read = service.asked[1:]
    assert begun.path == tried.path == "/v1/campaigns/c-1/calibrations"
    assert begun.json == tried.json == given
    assert read.path == "/v1/calibrations/k-1"
    (k,) = calibration.coefficients
    assert (k.name, k.value, k.standard_uncertainty, k.iso) == ("luminance_k", 33.1, 0.2, 3200)
    assert calibration.raw == CALIBRATION


def test_coefficients_as_known_then(service, client):
    row = K | {"calibration_id": "k-1", "version": 1, "flags": ["dark_from_black_level"]}
    service.will_answer({"items": [row], "next": None})
    at, known_at = datetime(2025, 6, 1, tzinfo=UTC), "2025-07-01T00:00:00Z"
    (k,) = client.coefficients("cam-1", iso=3200, at=at, known_at=known_at)
    asked = {"method": "luminance", "iso": "3200", "at": "2025-06-01T00:00:00+00:00", "known_at": known_at}
    assert service.asked[0].query == asked
    assert k.flags == ("dark_from_black_level",)


def test_a_certificate_for_programs_is_text(service, client):
    service.will_answer("<dcc>µ</dcc>".encode(), headers={"Content-Type": "application/xml"})
    assert client.certificate_dcc("k-1", country="DE") == "<dcc>µ</dcc>"


def test_the_history_of_a_camera(service, client):
    service.will_answer({"items": [CALIBRATION], "next": None})
    assert [found.id for found in client.history("cam-1", state="published")] == ["k-1"]
    assert service.asked[0].query == {"state": "published"}


def test_a_time_without_its_zone_is_refused():
    for moment in (datetime(2025, 1, 1), date(2025, 1, 1)):  # noqa: DTZ001  the point of the test
        with pytest.raises(ValueError, match="has no time zone"):
            as_text(moment)


def test_numbers_of_a_notebook_and_times_are_sent(service, client):
    service.will_answer({"polygon": [[0, 0], [1, 0], [1, 1]]})
    client.set_roi("cmp-1", polygon=np.array([[0, 0], [1, 0], [1, 1]]))
    assert service.asked[0].json == {"polygon": [[0, 0], [1, 0], [1, 1]]}
    service.will_answer({"items": []})
    at = datetime(2026, 5, 1, tzinfo=UTC)
    client.add_readings("cmp-1", [{"scene": "a", "value": np.int64(4), "taken_at": at}])
    assert service.asked[1].json == [{"scene": "a", "value": 4, "taken_at": "2026-05-01T00:00:00+00:00"}]


def test_a_key_is_never_shown_and_the_end_of_its_line_is_no_part_of_it(service):
    service.will_answer({"items": [], "next": None})
    with stilb.Client(service.url, "secret\n") as client:
        assert list(client.cameras()) == []
    assert service.asked[0].headers["authorization"] == "Bearer secret"
    for key in ("", "secret secret", "sécret"):
        with pytest.raises(stilb.Unclear, match="The key is empty, or") as found:
            stilb.Client(service.url, key)
        assert "secret" not in str(found.value)


def test_rows_of_a_series_have_the_same_columns(service, client):
    rows = [{"name": "a", "iso": 100}, {"name": "b", "valid_to": "2026-01-01T00:00:00Z"}]
    service.will_answer({"rows": rows})
    assert client.series(camera_id="cam-1", start="2025-01-01T00:00:00Z") == [
        {"name": "a", "iso": 100, "valid_to": None},
        {"name": "b", "iso": None, "valid_to": datetime(2026, 1, 1, tzinfo=UTC)},
    ]
    assert service.asked[0].query == {"camera_id": "cam-1", "from": "2025-01-01T00:00:00Z"}


def test_many_hashes_are_asked_in_parts(service, client):
    hashes = [f"{number:064x}" for number in range(1001)]
    known = {"sha256": hashes[0], "frame_id": "f", "filename": "n", "role": "light", "state": "read"}
    service.will_answer({"known": [known], "unknown": hashes[1:1000]})
    service.will_answer({"known": [], "unknown": hashes[1000:]})
    assert [frame.frame_id for frame in client.known_frames("c-1", [*hashes, hashes[0]])] == ["f"]
    assert [asked.json["sha256"] for asked in service.asked] == [hashes[:1000], hashes[1000:]]


def test_an_index_has_a_mean_alone(service, client):
    quantity = {"value": 0.5, "standard_uncertainty": 0.01, "unit": "1"}
    named = {"id": "m-1", "frame_id": "f-1", "filename": "a.TIF", "camera_id": "cam-1", "mean": quantity}
    service.will_answer(JOB, status=202)
    service.will_answer(job("succeeded", result={"measurement_id": "m-1"}))
    service.will_answer(named)
    found = client.measure("f-1", index="ndvi")
    assert service.asked[0].json == {"frame_id": "f-1", "index": "ndvi"}
    assert (found.mean.value, found.min) == (0.5, None)


def test_who_waits_may_run_out_of_time(service, client):
    service.will_answer(job("running"))
    with pytest.raises(TimeoutError, match="still running"):
        client.wait("j-1", timeout_s=0)
    service.will_answer(campaign_with(being_read=3))
    with pytest.raises(TimeoutError, match="3 frames of c-1 are not read after 0 s"):
        client.wait_for("c-1", timeout_s=0)


def test_a_refused_or_broken_download_leaves_the_file_as_it_was(service, client, tmp_path):
    path = tmp_path / "map.tif"
    path.write_bytes(b"an hour's work")
    service.will_refuse(404, "not_found")
    with pytest.raises(stilb.Problem, match="not_found"):
        client.save_map("m-1", path)
    service.will_answer(b"half", headers={"Content-Type": "image/tiff"}, withheld=4)
    with stilb.Client(service.url, "key", retries=0, timeout=2) as impatient, pytest.raises(stilb.Problem):
        impatient.save_map("m-1", path)
    assert path.read_bytes() == b"an hour's work"
    assert [each.name for each in tmp_path.iterdir()] == ["map.tif"]


@pytest.mark.parametrize("name", ["a" * 255, "ä" * 127, "CON.tif"])
def test_a_download_may_have_the_longest_name_that_there_is(service, client, tmp_path, name):
    service.will_answer(b"map", headers={"Content-Type": "image/tiff"})
    assert client.save_map("m-1", tmp_path / name).read_bytes() == b"map"
    assert [each.name for each in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize(
    ("filename", "stem"),
    [
        ("DJI_0001.DNG", "DJI_0001"),
        ("Straße 3.dng", "Straße 3"),
        ("no extension", "no extension"),
        ("NUL", "_NUL"),
        ("con.dng", "_con"),
        ("com¹.tar.gz", "_com¹.tar"),
        ("console.dng", "console"),
        ("12:30*?.DNG", "12_30__"),
        ("..\\..\\evil.DNG", "_.._evil"),
        ("dots . . .DNG", "dots"),
        (".DNG", "DNG"),
        ("...", "_"),
        ("ä" * 200 + ".DNG", "ä" * 90),
    ],
)
def test_a_name_of_others_becomes_one_that_windows_takes(filename, stem):
    assert plain_stem(filename) == stem


@pytest.mark.parametrize(
    ("frame", "name"),
    [
        ("DSC_1.DNG", "DSC_1.DNG"),
        ("DSC_1.DNG (abababab)", "DSC_1.DNG"),
        ("a (1).dng", "a__1_.dng"),
        (f"{'x' * 200}.DNG (abababab)", f"{'x' * 97}.DNG"),
        ("no extension", "no_extension"),
        ("CON.DNG", "CON.DNG"),  # the hash before it makes it no device
        ("a:b*c?. .", "a_b_c_._"),
        ("ends in a dot.", "ends_in_a_dot"),
        ("Straße.dng", "Stra_e.dng"),
        (f"{'x' * 150}.{'y' * 150}", f".{'y' * 100}"),
    ],
)
def test_an_exported_frame_keeps_its_extension(frame, name):
    assert frame_path({"sha256": "ab" * 32, "frame": frame}) == f"frames/{'ab' * 6}-{name}"
