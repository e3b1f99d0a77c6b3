"""Which frames enter a campaign, and what is said when one does not."""

import math
from dataclasses import replace

import pytest

from radiometry.findings import InputRejected, files, shared
from radiometry.frame import FrameHeader
from radiometry.frame.exposure import Camera, SuppliedExposure, accept_frame
from radiometry.specification.roles import ROLES

CAMERA = Camera(make="DJI", model="FC6520", serial="0AB12")
MEASURED = [role.name for role in ROLES if role.name != "chart"]
NOTHING = SuppliedExposure()
NOTES = SuppliedExposure(exposure_time_s=0.125, f_number=4.0, iso=3200.0)
HEADER = FrameHeader(
    container="dng",
    decoder="stilb",
    rendered=False,
    compression="none",
    bits_per_sample=12,
    width_px=5280,
    height_px=3956,
    cfa="RGGB",
    black_level_dn=(64.0,) * 4,
    black_level_origin="tag",
    white_level_dn=(4095.0,) * 4,
    white_level_origin="tag",
    exposure_time_s=0.125,
    f_number=4.0,
    iso=3200.0,
    exposure_mode="manual",
    make="DJI",
    model="FC6520",
    serial="0AB12",
)


def accept(role="light", supplied=NOTHING, **changes):
    return accept_frame(replace(HEADER, **changes), role=role, supplied=supplied, camera=CAMERA)


def refuse(role="light", supplied=NOTHING, **changes):
    with pytest.raises(InputRejected) as refusal:
        accept(role, supplied, **changes)
    return refusal.value


def test_a_good_frame():
    accepted = accept(exposure_time_apex_s=0.126, f_number_apex=4.01)
    assert accepted.flags == ()
    exposure = accepted.exposure
    assert (exposure.exposure_time_s, exposure.f_number, exposure.iso) == (0.125, 4.0, 3200.0)
    assert (exposure.exposure_time_apex_s, exposure.f_number_apex) == (0.126, 4.01)
    assert {exposure.exposure_time_origin, exposure.f_number_origin, exposure.iso_origin} == {"exif"}


@pytest.mark.parametrize("name", ["exposure_time_s", "f_number", "iso"])
@pytest.mark.parametrize("said", [None, 0.0])
@pytest.mark.parametrize("role", MEASURED)
def test_a_missing_or_zero_value_is_refused_by_name(name, said, role):
    refusal = refuse(role, **{name: said})
    assert refusal.code is shared.EXPOSURE_MISSING
    assert name in refusal.message
    assert "missing or zero" in refusal.message


def test_a_chart_needs_no_exposure():
    assert accept("chart", iso=None).exposure is None
    assert accept("chart").exposure.iso == 3200.0
    assert accept("chart", exposure_mode="auto").flags == ()


def test_apex_before_notes_where_the_nominal_value_is_missing():
    accepted = accept(supplied=NOTES, exposure_time_s=0.0, exposure_time_apex_s=1 / 8.2, iso=None)
    exposure = accepted.exposure
    assert (exposure.exposure_time_s, exposure.exposure_time_origin) == (1 / 8.2, "apex")
    assert (exposure.iso, exposure.iso_origin) == (3200.0, "supplied")
    assert exposure.f_number_origin == "exif"
    assert accepted.flags == ("exposure_from_apex", "exposure_supplied")


def test_notes_do_not_overrule_the_file():
    accepted = accept(supplied=SuppliedExposure(f_number=5.6))
    assert accepted.exposure.f_number == 4.0
    assert accepted.flags == ("supplied_exposure_ignored",)
    assert accept(supplied=SuppliedExposure(f_number=4.2)).flags == ()


@pytest.mark.parametrize("value", [math.nan, math.inf, -0.1, 1e9])
def test_an_absurd_value_is_refused_unless_the_notes_know_better(value):
    refusal = refuse(exposure_time_s=value)
    assert refusal.code is shared.EXPOSURE_IMPLAUSIBLE
    assert "exposure time" in refusal.message
    assert accept(supplied=NOTES, exposure_time_s=value).exposure.exposure_time_origin == "supplied"


def test_an_absurd_note_is_said_to_be_a_note():
    refusal = refuse(supplied=SuppliedExposure(iso=-3.0), iso=None)
    assert refusal.code is shared.EXPOSURE_IMPLAUSIBLE
    assert "-3 (as typed in)" in refusal.message


def test_an_absurd_apex_value_is_not_kept():
    assert accept(f_number_apex=math.inf).exposure.f_number_apex is None


@pytest.mark.parametrize(
    ("change", "word"),
    [({"serial": "0AB13"}, "serial number"), ({"model": "FC550"}, "model"), ({"make": "Canon"}, "make")],
)
def test_another_camera_is_refused_with_both_names(change, word):
    refusal = refuse(**change)
    assert refusal.code is shared.WRONG_CAMERA
    assert f"its {word} is '{next(iter(change.values()))}'" in refusal.message
    assert "DJI FC6520, serial number 0AB12" in refusal.message


NO_BLACK = {"black_level_dn": (0.0,) * 4, "black_level_origin": "default"}
AUTOMATIC = ("exposure_not_manual",)


@pytest.mark.parametrize(
    ("changes", "flags"),
    [
        ({"make": "dji ", "model": "FC6520\0\0", "serial": " 0ab12"}, ()),
        ({"make": None, "model": "", "serial": " \0"}, ("serial_unknown",)),
        ({"exposure_mode": "manual", "exposure_program": "program"}, ()),
        ({"exposure_mode": "auto", "exposure_program": "manual"}, AUTOMATIC),
        ({"exposure_mode": "bracket"}, AUTOMATIC),
        ({"exposure_mode": None, "exposure_program": "aperture_priority"}, AUTOMATIC),
        *(
            ({"exposure_mode": None, "exposure_program": each}, ())
            for each in ("manual", "not_defined", None)
        ),
        ({"rendered": True}, ("rendered",)),
        *(
            ({"role": "chart", "container": each, "rendered": True}, ("rendered",))
            for each in ("jpeg", "png")
        ),
        (NO_BLACK, (shared.BLACK_LEVEL_ASSUMED,)),
        (NO_BLACK | {"rendered": True}, (shared.RENDERED,)),
        ({"black_level_dn": (0.0,) * 4}, ()),
    ],
)
def test_what_is_flagged_of_a_frame_that_is_taken(changes, flags):
    assert accept(**changes).flags == flags


@pytest.mark.parametrize("container", ["jpeg", "png"])
@pytest.mark.parametrize("role", MEASURED)
def test_a_picture_is_refused_wherever_light_is_measured(container, role):
    refusal = refuse(role, container=container, rendered=True)
    assert refusal.code is files.NOT_A_RAW_FILE
    assert f"{container.upper()} picture" in refusal.message
    assert refusal.message.endswith("Send the camera's raw file (DNG), or a TIFF.")
