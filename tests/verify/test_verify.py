"""A certificate is recomputed to the last bit or to rounding, and whatever was changed is found and named."""

import json

import pytest

import stilb
import stilb.__main__
from stilb.export import frame_path
from tests.support.certificates import certificate_of, export_version
from tests.support.house import KEY
from tests.verify.changing import change, nudge, run
from verify.__main__ import main
from verify.compare import Row, compare


def test_a_changed_frame_is_found_by_its_hash_and_moves_k(capsys, exported):
    certificate = json.loads((exported / "certificate.json").read_text())
    frame = next(frame for frame in certificate["frames"] if frame["role"] == "light")
    path = exported / frame_path(frame)
    content = bytearray(path.read_bytes())
    middle = len(content) // 2  # among the samples, which are most of the file
    for sample in (middle & ~1, (middle & ~1) + 2):  # of two neighbours in a row one is green
        content[sample] ^= 0x40
    path.write_bytes(content)
    code, said = run(capsys, exported)
    assert code == 1
    assert f"frame files: {frame['frame']} SHA-256 │ {frame['sha256']}" in said
    assert f"frame statistics: {frame['frame']}.signal_dn" in said
    assert "content hash: content SHA-256" in said
    k = said.split("Luminance K, ISO 3200, green │")[1].split("u(Luminance K")[0]
    assert "NO" in k


@pytest.mark.parametrize("damage", ["missing", "cut off"])
def test_a_frame_that_cannot_be_read_is_said(capsys, exported, damage):
    certificate = json.loads((exported / "certificate.json").read_text())
    path = exported / frame_path(certificate["frames"][0])
    if damage == "missing":
        path.unlink()
    else:
        path.write_bytes(path.read_bytes()[:2000])
    code, said = run(capsys, exported)
    assert code == 1
    assert f"frames: {certificate['frames'][0]['frame']} │ can be read │" in said


def test_an_edited_list_of_sums_is_found(capsys, exported):
    sums = (exported / "SHA256SUMS").read_text()
    for edited in (sums.replace(sums[:8], "0" * 8, 1), sums.partition("\n")[2], sums + "\nmore"):
        (exported / "SHA256SUMS").write_text(edited)
        code, said = run(capsys, exported)
        assert (code, "SHA256SUMS: " in said) == (1, True)
    (exported / "SHA256SUMS").unlink()
    assert run(capsys, exported)[0] == 0


def test_a_changed_reading_is_found_and_moves_k(capsys, exported):
    change(exported / "readings.json", nudge((0, "value"), by=0.001))
    code, said = run(capsys, exported)
    assert code == 1
    assert "readings: [0].value │" in said
    assert "+1.00e-03" in said
    assert "NO" in said.split("Luminance K, ISO 3200, green │")[1].split("u(Luminance K")[0]


K = ("result", "iso_fits", 0, "coefficient", "luminance_k")
COMPUTED = {
    K: "iso_fits: iso_fits[0].coefficient.luminance_k",
    ("result", "points", 3, "residual_rel"): "points: points[3].residual_rel",
    ("budgets", 0, "lines", 0, "u_rel"): "budgets: budgets[0].lines[0].u_rel",
}
GIVEN = {
    ("frames", 2, "statistics", 0, "std_dn"): ".statistics[0].std_dn",
    ("readings", 1, "value"): "readings: [1].value",
    ("parameters", "exposure_time_u_rel"): "content hash: content SHA-256",
    ("meters", 0, "certificate", "expanded_uncertainty_rel"): "[0].expanded_uncertainty_rel",
    ("regions", 0, "points", 0, 0): "regions: [0].points[0][0]",
}


@pytest.mark.parametrize("places", [COMPUTED, GIVEN], ids=["computed", "given"])
def test_each_changed_number_in_the_certificate_is_found(capsys, exported, places):
    """By a millionth, and although the data's own copy was changed along with it."""
    for place in places:
        change(exported / "certificate.json", nudge(place))
    code, said = run(capsys, exported)
    assert (code, "quantities differ." in said) == (1, True)
    assert [named for named in places.values() if f"{named} │" not in said] == []


def test_last_bits_of_another_processor_are_rounding(capsys, exported):
    change(exported / "certificate.json", nudge(K, by=1e-13))
    code, said = run(capsys, exported)
    assert code == 0
    assert "quantities are the same to rounding" in said
    assert ", 1 to 4e-12 of their uncertainty or size." in said


@pytest.mark.parametrize(
    ("changes", "code", "told"),
    [
        ({"work": {"recorder": "somebody else"}}, 1, "work.recorder │ somebody else │ A. Meier │ NO"),
        ({"validity": {"state": "published", "valid_from": "2026-05-01T00:00:00Z"}}, 0, ""),
    ],
    ids=["changed", "decided later"],
)
def test_a_certificate_is_held_against_the_one_that_came_with_the_data(
    capsys, exported, tmp_path, changes, code, told
):
    certificate = json.loads((exported / "certificate.json").read_text())
    mine = tmp_path / "mine.json"
    mine.write_text(json.dumps(certificate | {name: certificate[name] | of for name, of in changes.items()}))
    assert main([str(mine), "--data", str(exported)]) == code
    said = " ".join(capsys.readouterr().out.split())
    assert not told or f"the data's own certificate: {told}" in said


@pytest.mark.parametrize(
    "content",
    ["", "[]", "{}", '{"schema_version": 2}', '{"schema_version": 1, "x": NaN}', '{"schema_version": 1}'],
)
def test_what_is_no_certificate_is_neither_right_nor_wrong(capsys, exported, content):
    (exported / "certificate.json").write_text(content)
    code, said = run(capsys, exported)
    assert code == 2
    assert said.startswith("verify: ")


def test_a_frame_cannot_lead_out_of_the_folder(capsys, exported):
    change(exported / "certificate.json", lambda of: of["frames"][0].update(sha256="../../../etc/passwd"))
    assert run(capsys, exported)[0] == 2


def test_help_shows_an_example_and_the_data_must_be_named(capsys):
    with pytest.raises(SystemExit, match="0"):
        main(["--help"])
    example = "Example:\n  stilb-verify calibration/certificate.json --data calibration"
    assert example in capsys.readouterr().out
    with pytest.raises(SystemExit, match="2"):
        main(["certificate.json"])


def test_a_certificate_on_a_server_is_verified_from_there(capsys, exports, address, tmp_path):
    version = exports.version("luminance")
    place = f"{address}/v1/calibrations/{version['id']}/certificate.json"
    assert main([place, "--key", KEY]) == 0
    assert main([place, "--key", "wrong"]) == 2
    assert "unauthenticated" in capsys.readouterr().out
    doctored = certificate_of(exports.house, version)
    doctored["readings"][0]["value"] *= 1.01
    (tmp_path / "doctored.json").write_text(json.dumps(doctored))
    assert main([str(tmp_path / "doctored.json"), "--data", address, "--key", KEY]) == 1


NOBODY = {"name": "nobody", "role": "none"}


def test_what_was_issued_is_checked_byte_for_byte_with_its_amendments(exports, address, tmp_path, capsys):
    house, version = exports.house, exports.version("luminance")
    body = {"valid_from": "2026-05-01T00:00:00Z", "reason": "spring"}
    for reason in ("spring", "another period"):
        house.post(f"/v1/calibrations/{version['id']}/publish", body | {"reason": reason}, status=200)
    folder = export_version(house, version, tmp_path / "export")
    original = json.loads((folder / "certificate.json").read_text())
    status = json.loads((folder / "status.json").read_text())
    assert (status["state"], len(status["certificates"])) == ("published", 2)
    assert (folder / "amendment-1.pdf").read_bytes().startswith(b"%PDF-")
    code, said = run(capsys, folder)
    assert (code, "issued files (all) │ 4 │ 4 the same │ yes" in said) == (0, True)
    change(folder / "status.json", lambda status: status.update(state="revoked", revoked_reason="it fell"))
    code, said = run(capsys, folder, "amendment-1.json")
    assert (code, "The version was revoked when it was exported (it fell)." in said) == (0, True)
    change(folder / "status.json", lambda edited: edited.update(status))
    for name, edit in {
        "state": lambda status: status.update(state="draft"),
        "state ": lambda status: status.update(revoked_reason="it fell", state="published"),
        "version": lambda status: status.update(version=7),
        "validity": lambda status: status.update(valid_from="2025-01-01T00:00:00Z"),
        "certificates[1].reason": lambda status: status["certificates"][1].update(reason="other"),
        "certificates[0].approved_by": lambda status: status["certificates"][0].update(approved_by=NOBODY),
    }.items():
        change(folder / "status.json", edit)
        code, said = run(capsys, folder)
        assert (code, f"status.json: {name.strip()}" in said) == (1, True), said
        (folder / "status.json").write_text(json.dumps(status))
    place = f"{address}/v1/calibrations/{version['id']}/certificate.json?amendment=1"
    assert main([place, "--key", KEY]) == 0
    capsys.readouterr()
    # the same JSON in other bytes, and pages that are others
    (folder / "certificate.json").write_text(json.dumps(original, indent=1))
    (folder / "amendment-1.pdf").unlink()
    code, said = run(capsys, folder)
    assert code == 1
    for name, found in (("certificate.json", ""), ("amendment-1.pdf", "absent")):
        assert f"issued files: {name} SHA-256 │" in said
        assert found in said
    # of what was issued every word is compared, also what may change while it is a draft
    (folder / "certificate.json").write_text(json.dumps(original))
    doctored = tmp_path / "doctored.json"
    doctored.write_text(json.dumps(original | {"approved_by": {"name": "X", "role": "y"}}))
    assert main([str(doctored), "--data", str(folder)]) == 1
    assert "the data's own certificate: approved_by.name" in " ".join(capsys.readouterr().out.split())


def test_the_clients_export_is_taken_up_where_it_stopped(exports, address, tmp_path):
    house, version = exports.house, exports.version("luminance")
    told = []
    with stilb.Client(address, KEY) as client:
        folder = client.export(version["id"], tmp_path / "out", on_progress=told.append)
        frames = certificate_of(house, version)["frames"]
        assert [progress.files_done for progress in told] == list(range(1, len(frames) + 1))
        assert told[-1].bytes_done == told[-1].bytes_total == sum(frame["size_bytes"] for frame in frames)
        for frame in frames:
            sent = house.http.get(f"/v1/frames/{frame['id']}/content").content
            assert (folder / frame_path(frame)).read_bytes() == sent
        kept, damaged = (folder / frame_path(frame) for frame in frames[:2])
        damaged.write_bytes(b"half")
        before = kept.stat().st_mtime_ns, kept.stat().st_ino
        client.export(version["id"], folder)
        assert (kept.stat().st_mtime_ns, kept.stat().st_ino) == before
    assert damaged.stat().st_size == frames[1]["size_bytes"]
    assert (folder / "certificate.pdf").read_bytes().startswith(b"%PDF")
    assert not list(folder.rglob("*.part"))


@pytest.mark.parametrize(
    ("stated", "found", "differing"),
    [
        ({"a": 1.0}, {"a": 1}, []),
        ({"a": True}, {"a": 1}, ["a"]),
        ({"a": 1.0}, {"a": 1.0000000000000002}, ["a"]),
        ({"a": 1}, {"b": 1}, ["a", "b"]),
        ({"a": [1, 2]}, {"a": [1]}, ["a count"]),
        ({"a": [1]}, {"a": {"0": 1}}, ["a"]),
        ({"a": {"b": [{"c": "x"}]}}, {"a": {"b": [{"c": "y"}]}}, ["a.b[0].c"]),
    ],
)
def test_leaves_are_compared_to_the_last_bit(stated, found, differing):
    assert [row.quantity for row in compare("", stated, found) if not row.same] == differing


@pytest.mark.parametrize(
    ("stated", "found", "agreement"),
    [
        ({"k": 2.0}, {"k": 2.0 + 1e-10}, "rounding"),
        ({"k": 2.0}, {"k": 2.0 + 1e-8}, "different"),
        # beside its uncertainty a number near 0 is as good as 0, and one that is known well is held tighter
        (
            {"k": 1e-12, "k_standard_uncertainty": 0.1},
            {"k": 3e-12, "k_standard_uncertainty": 0.1},
            "rounding",
        ),
        (
            {"value": 2.0, "standard_uncertainty": 1e-3},
            {"value": 2.0 + 1e-10, "standard_uncertainty": 1e-3},
            "different",
        ),
        ([{"residual": 1e-16}, {"residual": 0.01}], [{"residual": 3e-16}, {"residual": 0.01}], "rounding"),
        (
            {"covariance": [[1.0, 1e-16], [1e-16, 1.0]]},
            {"covariance": [[1.0, -1e-16], [1e-16, 1.0]]},
            "rounding",
        ),
        (
            {"parameters": [2.0, 1e-12], "covariance": [[1e-4, 0.0], [0.0, 0.04]]},
            {"parameters": [2.0, 3e-12], "covariance": [[1e-4, 0.0], [0.0, 0.04]]},
            "rounding",
        ),
        ([1e-16, *[1.0] * 15], [0.0, *[1.0] * 15], "rounding"),
        ([1e-16, 1.0], [0.0, 1.0], "different"),
        ({"n": 10**12}, {"n": 10**12 + 1}, "different"),
        ({"a": "1.0"}, {"a": "1.00"}, "different"),
    ],
)
def test_rounding_is_judged_by_the_scale_of_a_number(stated, found, agreement):
    (row,) = [row for row in compare("", stated, found) if not row.same]
    assert row.agreement == agreement


def test_a_difference_is_relative_to_what_the_certificate_says():
    row = Row(group="", quantity="", certificate=-2.0, recomputed=-2.002)
    assert row.difference == "-1.00e-03"
