"""Each rule of the checklist against a campaign that breaks exactly that."""

from dataclasses import replace
from itertools import product

import pytest

from radiometry.checklist import ITEMS, Facts, FrameFacts, IsoFacts, VersionFacts, find

ISOS, APERTURES, LEVELS = (3200.0, 6400.0), (4.0, 5.6), ("bright", "dim", "middle")
ISO = IsoFacts(
    iso=3200.0,
    model="proportional",
    luminance_k=33.1,
    luminance_k_standard_uncertainty=0.4,
    luminance_k_unit="DN*m2/(cd*s)",
    dark_signal_dn=256.5,
    dark_frames=2,
    points=6,
)


def frame(role, scene, iso, f_number):
    return FrameFacts(
        name=f"{scene or 'dark'}-{iso:g}-{f_number:g}",
        role=role,
        scene=scene,
        container="dng",
        rendered=False,
        manual=True,
        exposure_time_s=0.01,
        f_number=f_number,
        iso=iso,
        typed_in=(),
        extracted=True,
    )


COMPLETE = Facts(
    project_number="P-17",
    started_on="2026-05-01",
    started_at="20:00 UTC",
    recorder="A. Meier",
    frames=(
        *(frame("light", scene, iso, f) for scene, iso, f in product(LEVELS, ISOS, APERTURES)),
        *(frame("dark", None, iso, f) for iso, f in product(ISOS, APERTURES)),
    ),
    unread=(),
    readings={"bright": (54.4, 54.5), "middle": (2.94,), "dim": (0.26,)},
    region=((8.0, 8.0), (88.0, 8.0), (88.0, 56.0)),
    version=VersionFacts(version=1, isos=(ISO, replace(ISO, iso=6400.0))),
)


def without(facts, unwanted):
    return replace(facts, frames=tuple(f for f in facts.frames if not unwanted(f)))


def with_first(facts, role, **changes):
    index = next(i for i, f in enumerate(facts.frames) if f.role == role)
    frames = list(facts.frames)
    frames[index] = replace(frames[index], **changes)
    return replace(facts, frames=tuple(frames))


def open_items(facts):
    return {key for key, finding in find(facts).items() if not finding.done}


def test_the_print_has_its_items_each_under_a_key_of_its_own():
    counts = {
        section: sum(item.section == section for item in ITEMS)
        for section in dict.fromkeys(i.section for i in ITEMS)
    }
    assert list(counts.values()) == [4, 8, 4, 10, 6, 8, 4, 4]
    assert len({item.key for item in ITEMS}) == len(ITEMS)


def test_every_rule_is_about_an_item():
    assert set(find(COMPLETE)) <= {item.key for item in ITEMS}


def test_a_complete_campaign_leaves_nothing_open():
    assert open_items(COMPLETE) == set()


def test_an_empty_campaign_leaves_everything_open():
    empty = Facts(
        project_number=None,
        started_on=None,
        started_at=None,
        recorder=None,
        frames=(),
        unread=(),
        readings={},
        region=(),
        version=None,
    )
    assert open_items(empty) == set(find(empty))


FRAMES = {
    "settings_exposure_manual",
    "settings_format_dng",
    "shooting_iso_and_apertures",
    "shooting_every_combination",
    "shooting_settings_recorded",
}
STATISTICS = {
    *("extract_to_tiff", "extract_imagej_open", "extract_first_image", "extract_script_filled"),
    *("extract_script_run", "extract_results_saved"),
}
VERSION = {
    *("dark_median", "calibration_dark_subtracted", "calibration_rhs", "calibration_plot"),
    "calibration_regression",
}


@pytest.mark.parametrize(
    ("facts", "left_open", "said"),
    [
        (replace(COMPLETE, recorder=None), {"general_recorder"}, "Not recorded."),
        (
            replace(COMPLETE, readings={"bright": (1.0,), "dim": (1.0,)}),
            {"scenes_luminance_readings"},
            "middle",
        ),
        (with_first(COMPLETE, "dark", manual=None), {"settings_exposure_manual"}, "1 frame (dark-3200-4)"),
        (with_first(COMPLETE, "light", manual=False), {"settings_exposure_manual"}, "(bright-3200-4)"),
        (with_first(COMPLETE, "light", container="tiff"), {"settings_format_dng"}, "(bright-3200-4)"),
        (with_first(COMPLETE, "light", rendered=True), {"settings_format_dng"}, "(bright-3200-4)"),
        (
            without(COMPLETE, lambda f: f.name == "dim-3200-4"),
            {"shooting_every_combination"},
            "dim lacks a frame at ISO 3200, f/4, 1/100 s",
        ),
        (
            without(COMPLETE, lambda f: f.scene == "dim" and f.iso == 3200.0),
            {"shooting_iso_and_apertures", "shooting_every_combination"},
            "ISO 3200 lacks",
        ),
        (
            without(COMPLETE, lambda f: f.role == "light" and f.iso == 3200.0 and f.f_number == 4.0),
            {"shooting_iso_and_apertures"},
            "single aperture",
        ),
        (without(COMPLETE, lambda f: f.scene == "dim"), {"scenes_levels"}, "photographed: 2"),
        (
            without(COMPLETE, lambda f: f.role == "dark" and f.iso == 6400.0),
            {"dark_frames"},
            "ISO 6400 has no dark frame",
        ),
        (
            without(COMPLETE, lambda f: f.role == "dark" and f.f_number == 4.0),
            {"dark_frames"},
            "single aperture",
        ),
        (
            without(COMPLETE, lambda f: f.role == "dark"),
            {"scenes_levels", "dark_frames", "dark_extracted"},
            "dark",
        ),
        (with_first(COMPLETE, "light", extracted=False), STATISTICS, "bright-3200-4"),
        (with_first(COMPLETE, "dark", extracted=False), STATISTICS | {"dark_extracted"}, "dark-3200-4"),
        (replace(COMPLETE, region=()), {"extract_polygon", "extract_coordinates"}, "No region"),
        (replace(COMPLETE, unread=("late.DNG",)), FRAMES | STATISTICS | {"dark_frames"}, "late.DNG"),
        (replace(COMPLETE, version=None), VERSION, "not been fitted"),
        (
            replace(
                COMPLETE,
                version=replace(COMPLETE.version, isos=(ISO, replace(ISO, iso=6400.0, dark_frames=0))),
            ),
            {"dark_median"},
            "ISO 6400",
        ),
    ],
)
def test_one_thing_lacking_opens_its_items_and_says_which(facts, left_open, said):
    assert open_items(facts) == left_open
    findings = find(facts)
    assert any(said in findings[key].sentence for key in left_open)


def test_an_iso_or_an_aperture_outside_the_print_stays_open():
    iso = replace(COMPLETE, frames=tuple(replace(f, iso=f.iso / 2) for f in COMPLETE.frames))
    wide = with_first(COMPLETE, "light", f_number=1.4)
    assert "ISO 1600 is none of" in find(iso)["shooting_iso_and_apertures"].sentence
    assert "outside F1.7 to F16: 1 frame" in find(wide)["shooting_iso_and_apertures"].sentence
    edges = {4.0: 1.7, 5.6: 16.0}
    allowed = replace(COMPLETE, frames=tuple(replace(f, f_number=edges[f.f_number]) for f in COMPLETE.frames))
    assert open_items(allowed) == set()


def test_a_value_typed_in_is_said():
    facts = with_first(COMPLETE, "light", typed_in=("ISO",))
    assert "typed in where the file lacks them: 1 frame (bright-3200-4)" in (
        find(facts)["shooting_settings_recorded"].sentence
    )


def test_many_frames_are_counted_and_the_first_named():
    sentence = find(COMPLETE)["settings_format_dng"].sentence
    assert "16 frames (bright-3200-4, " in sentence
    assert "and 10 more)" in sentence
