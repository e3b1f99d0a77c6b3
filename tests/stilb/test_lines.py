"""Lines that a command ends with: equal ones are one, with what they hold for."""

from stilb.commands.calibration import format_impact
from stilb.commands.measurements import format_measurements
from stilb.commands.terminal import format_findings, lines
from stilb.field.push import Report, Told

REGION = "No region (ROI) is drawn yet: draw it on the preview, for the campaign or for this frame."


def told(name, outcome, *reasons):
    return Told(name=name, sha256=name, frame_id=name, outcome=outcome, reasons=reasons)


def test_files_of_equal_reasons_are_told_once():
    files = [told(f"DJI_{number}.DNG", "pending", REGION) for number in range(141)]
    report = Report(
        campaign_id="cmp_1", files=(*files, told("dark.DNG", "pass"), told("x.DNG", "fail", "x")), sent=0
    )
    assert list(lines(report)) == [
        "141 files: DJI_0.DNG, DJI_1.DNG, DJI_2.DNG, DJI_3.DNG, DJI_4.DNG and 136 more  pending",
        f"    {REGION}",
        "x.DNG  fail",
        "    x",
        report.sentence(),
    ]


def test_reasons_that_differ_only_in_numbers_are_told_once():
    clipped = ("{}% of the region is clipped, at ISO 3200.", "Expose less.")
    shares = {"a.DNG": "0.35", "b.DNG": "12", "c.DNG": "12.0"}
    files = [told(name, "fail", clipped[0].format(share), clipped[1]) for name, share in shares.items()]
    report = Report(campaign_id="cmp_1", files=(*files, told("d.DNG", "fail", "Damaged.")), sent=0)
    assert list(lines(report))[:-1] == [
        "a.DNG, b.DNG, c.DNG  fail",
        "    0.35 to 12% of the region is clipped, at ISO 3200.",
        "    Expose less.",
        "d.DNG  fail",
        "    Damaged.",
    ]


def test_numbers_in_the_name_of_another_file_are_no_range():
    seen = "{}.DNG shows scene level-1 at ISO {}, 1/60 s already."
    files = [told("b.DNG", "warn", seen.format("DJI 0001", 400))]
    files.append(told("e.DNG", "warn", seen.format("DJI 0004", 800)))
    report = Report(campaign_id="cmp_1", files=tuple(files), sent=0)
    assert list(lines(report))[:-1] == [
        "b.DNG, e.DNG  warn",
        "    b.DNG: DJI 0001.DNG shows scene level-1 at ISO 400, 1/60 s already.",
    ]


def test_publishing_tells_which_iso_values_it_takes_out_of_force():
    impact = {
        "said": "It replaces version 1.",
        "coefficients": [],
        "isos_gained": [],
        "isos_lost": [400.0, 800.0],
    }
    made_with_it = {"measurement_id": "msr_1"}
    assert format_impact(impact | {"measurements": [made_with_it]}) == [
        "It replaces version 1.",
        "loses ISO 400, 800",
        "made with the version in force: 1 measurement",
    ]


def test_frames_that_are_not_measured_for_one_reason_are_told_once():
    """A reason names its frame and its time: that of the first stands for all."""
    names = [f"DJI_{number}.DNG" for number in range(141)]
    refused = [
        {"filename": name, "detail": f"Frame {name} was taken at 20:{n % 60:02}: no version is in force."}
        for n, name in enumerate(names)
    ]
    refused.append({"filename": "a.DNG", "detail": "Frame a.DNG is withdrawn."})
    _, *said = format_measurements([], refused)
    assert said == [
        "141 frames: DJI_0.DNG, DJI_1.DNG, DJI_2.DNG, DJI_3.DNG, DJI_4.DNG and 136 more  not measured",
        "    Frame DJI_0.DNG was taken at 20:00: no version is in force.",
        "a.DNG  not measured",
        "    Frame a.DNG is withdrawn.",
    ]


def test_equal_findings_are_a_line_with_their_subjects():
    scenes = [f"scene level-{number}" for number in range(20)]
    found = {"code": "lamp_drift", "severity": "warn", "count": 20, "subjects": scenes, "values": {}}
    (line,) = format_findings([found | {"detail": "It drifts: wait.", "action": "Wait."}])
    assert "It drifts: wait. (" in line
    (line,) = format_findings([found | {"detail": "It drifts", "action": "Wait."}])
    assert line == (
        "warn lamp_drift: It drifts. Wait. (scene level-0, scene level-1, scene level-2, scene level-3, "
        "scene level-4 and 15 more)"
    )
