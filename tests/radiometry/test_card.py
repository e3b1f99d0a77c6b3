"""Method, role and scene of each frame of a card."""

from dataclasses import replace

import pytest

from radiometry.card import CardFrame, choose_methods, sort_card, split_scenes


def frame(name, minute=0.0, *, signal=0.3, exposure_time_s=0.01, **more):
    said = {"f_number": 4.0, "iso": 100.0, "signal_share": signal, "exposure_time_s": exposure_time_s, **more}
    known = {key: value for key, value in said.items() if value is not None}
    return CardFrame(name=name, taken_s=1e9 + 60 * minute, **known)


def sort(frames, *, in_force=(), there=()):
    best, night, is_night = choose_methods(frames, in_force)
    spec = night if is_night else best
    found = sort_card(frames, spec, night=is_night, there=there)
    return spec.name, is_night, [(each.role, each.scene) for each in found]


def test_flat_card_is_split_at_pauses_and_darks_are_found_by_their_centre():
    card = [frame(f"DCIM/100MEDIA/DJI_{n:04}.DNG", n / 10 + 5 * (n // 4)) for n in range(12)]
    card += [frame(f"DCIM/100MEDIA/DJI_{n:04}.DNG", n / 10 + 20, signal=0.0) for n in range(12, 14)]
    method, is_night, found = sort(card)
    assert (method, is_night) == ("luminance", False)
    assert found == [("light", f"Scene {1 + n // 4}") for n in range(12)] + [("dark", None)] * 2


def test_scene_begins_with_another_exposure_after_two_usual_pauses():
    card = [frame(f"{n}.DNG", n / 6 + (n > 3) / 3, exposure_time_s=0.01 if n < 4 else 0.05) for n in range(8)]
    assert [scene for _, scene in sort(card)[2]] == ["Scene 1"] * 4 + ["Scene 2"] * 4


@pytest.mark.parametrize("root", ["night/", ""])
def test_folders_name_scenes(root):
    card = [frame(f"{root}level-{n % 2}/{n}.DNG", n) for n in range(8)]
    assert [scene for _, scene in sort(card)[2]] == ["level-0", "level-1"] * 4


def test_one_folder_names_a_scene_only_if_its_frames_are_of_one_time():
    dark = frame("card/dark/9.DNG", 50, signal=0.0)
    one = [frame(f"card/hall/{n}.DNG", n / 10, signal=0.001 * n) for n in range(4)]
    assert [scene for _, scene in sort([*one, dark])[2]] == ["hall"] * 4 + [None]
    two = [*one, *(frame(f"card/hall/{n}.DNG", 30 + n / 10) for n in range(4, 8))]
    assert [scene for _, scene in sort([*two, dark])[2]] == ["Scene 1"] * 4 + ["Scene 2"] * 4 + [None]


def test_method_follows_names_bands_pictures_and_what_is_in_force():
    flats = [*(frame(f"flat/{n}.DNG") for n in range(3)), frame("dark/1.DNG", signal=0.0)]
    assert sort(flats)[0] == "vignetting"
    assert [role for role, _ in sort(flats)[2]] == ["flat"] * 3 + ["dark"]
    series = [frame(f"flat/{n}.DNG", exposure_time_s=0.01 * (n // 2)) for n in range(2, 12)]
    chosen_by_the_camera = [frame(f"flat/{n}.DNG", exposure_time_s=0.01 + n // 2 / 1e4) for n in range(8)]
    assert [sort(card)[0] for card in (series, series[::2], chosen_by_the_camera)] == [
        "noise",
        *["vignetting"] * 2,
    ]
    assert sort([replace(each, f_number=1.4 * n) for n, each in enumerate(series, 1)])[0] == "vignetting"
    assert sort([replace(each, name=f"{n}.DNG") for n, each in enumerate(series)])[0] == "luminance"
    assert sort([frame(f"{n}.TIF", band=band) for n, band in enumerate(("Green", "Red"))])[0] == "reflectance"
    assert sort([frame(f"{n}.JPG", signal=None) for n in range(3)])[::2] == (
        "sharpness",
        [("chart", None)] * 3,
    )
    plain = [frame(f"100MEDIA/{n}.DNG") for n in range(5)]
    assert sort(plain, in_force={"luminance"}) == ("luminance", True, [("field", None)] * 5)
    assert sort(plain)[1] is False
    # a dark frame beside them is no night
    assert sort([*plain, frame("100MEDIA/9.DNG", signal=0.0)], in_force={"luminance"})[1] is False


def test_scenes_of_a_campaign_go_on():
    """A second card neither renames the first one's scenes nor joins another light level to them."""
    there = [frame(f"DJI_{n}.DNG", n / 10, scene="dusk") for n in range(4)]
    card = [frame(f"DJI_{n}.DNG", n / 10) for n in range(3, 6)]
    card += [frame(f"DJI_{n}.DNG", 60 + n / 10) for n in range(6, 9)]
    assert [scene for _, scene in sort(card, there=there)[2]] == ["dusk"] * 3 + ["Scene 1"] * 3
    taken = [frame(f"DJI_{n}.DNG", n / 10, scene="Scene 1") for n in range(4)]
    assert [scene for _, scene in sort(card[3:], there=taken)[2]] == ["Scene 2"] * 3


def test_frames_without_times_are_one_scene_in_the_order_of_their_names():
    names = [f"DJI_{n}.DNG" for n in (10, 9, 1)]
    (scene,) = split_scenes(frame(name) for name in names)
    assert [each.name for each in scene] == ["DJI_1.DNG", "DJI_9.DNG", "DJI_10.DNG"]
    assert split_scenes([]) == []


def test_absurd_names_and_exposures_are_sorted_too():
    """A superscript is a digit and no number, and the square of a tiny f-number is zero."""
    card = [frame("².DNG"), frame("a/²", 1.0, f_number=1e-300), frame("b.DNG", 2.0, iso=1e8)]
    assert [role for role, _ in sort(card)[2]] == ["light"] * 3
    assert split_scenes(card)[0][0].name == "².DNG"
