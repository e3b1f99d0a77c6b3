"""Spectral mismatch: published lamps and cameras against known answers, and curves by hand."""

import json

import numpy as np
import pytest

from radiometry.findings import InputRejected
from radiometry.spectral import mismatch
from tests.support.data import data_file

GREEN = {"channel": "green", "calibrated": "A"}
FLAT = "\n".join(f"{nm},1" for nm in range(380, 781, 10))


def shown_rel(camera, lamp):
    """Shown over true luminance, less 1, in %: the negative of what F corrects."""
    return 100.0 / mismatch.compute_mismatch(camera, **GREEN, measured=lamp) - 100.0


# CIE 015:2018 lamps and the published responses, computed independently
KNOWN = {
    "Nikon D5100": {"HP1": -29, "LED-B3": 11, "LED-B4": 17, "LED-B5": 26},
    "Hasselblad L2D-20c": {"HP1": -23, "LED-B3": 10, "LED-B4": 14, "LED-B5": 22},
    "Hasselblad L1D-20c": {"HP1": -22, "LED-B3": 5, "LED-B4": 5, "LED-B5": 12},
}


@pytest.mark.parametrize(("camera", "lamps"), KNOWN.items())
def test_published_cameras_err_as_published(camera, lamps):
    assert {lamp: round(shown_rel(camera, lamp)) for lamp in lamps} == lamps


@pytest.mark.parametrize(
    ("camera", "percent"), [("Hasselblad L2D-20c", 56), ("Hasselblad L1D-20c", 53), ("Nikon D5100", 65)]
)
def test_f1_prime_of_published_cameras(camera, percent):
    assert 100 * mismatch.compute_f1_prime(camera, channel="green") == pytest.approx(percent, abs=0.6)


def test_ideal_photometer_has_no_mismatch():
    v = "\n".join(
        f"{nm},0.1,{value},0.1"
        for nm, value in zip(range(380, 781, 5), mismatch.read_observer(), strict=True)
    )
    assert mismatch.compute_f1_prime(v, channel="green") == pytest.approx(0.0, abs=1e-12)
    assert mismatch.compute_mismatch(v, **GREEN, measured="HP1") == pytest.approx(1.0)


def test_mismatch_by_hand():
    """Lines at 500 and 600 nm: V is 0.323 and 0.631; the response 1 and 2."""
    lines = ["\n".join(f"{nm},{1 if nm == line else 0}" for nm in range(380, 781)) for line in (500, 600)]
    ramp = "\n".join(f"{nm},0.1,{1 + (nm - 500) / 100 if nm >= 400 else 0},0.1" for nm in range(380, 781))
    factor = mismatch.compute_mismatch(ramp, channel="green", calibrated=lines[0], measured=lines[1])
    assert factor == pytest.approx((0.631 / 2) * (1 / 0.323))
    huge = lines[1].replace(",1", ",1e308")
    assert mismatch.compute_mismatch(ramp, channel="green", calibrated=lines[0], measured=huge) == factor
    blind = "\n".join(f"{nm},0.1,{1 if nm < 550 else 0},0.1" for nm in range(380, 781))
    with pytest.raises(InputRejected):
        mismatch.compute_mismatch(blind, channel="green", calibrated=lines[0], measured=lines[1])


@pytest.mark.parametrize(
    ("camera", "rms"),
    [
        ("Hasselblad L2D-20c", 2.3),
        ("Nikon D5100", 3.9),
        ("Panasonic DC-GX9", 2.9),
        ("Hasselblad L1D-20c", 6.0),
    ],
)
def test_colour_predicts_a_lamp_from_the_others(camera, rms):
    remedy = mismatch.fit_colour_remedy((camera,), channel="green", calibrated=("A",))
    assert 100 * remedy.rms_rel == pytest.approx(rms, abs=0.06)
    rgb, errors = mismatch.read_response(camera), []
    for name in mismatch.list_lamps():
        here, there = (rgb.T @ mismatch.read_lamp(lamp) for lamp in (name, "A"))
        red, _, blue = (here / here[1]) / (there / there[1])
        errors.append(
            remedy.predict(red, blue) / mismatch.compute_mismatch(camera, **GREEN, measured=name) - 1.0
        )
    # of the lamps themselves it errs less than of a lamp that it does not know
    assert np.sqrt(np.mean(np.square(errors))) < remedy.rms_rel
    assert remedy.predict(20.0, 1.0) is None


def test_uncertainty_is_least_for_the_same_lamp_and_grows_with_the_correction():
    same, near, far = (
        mismatch.estimate_u_rel("Nikon D5100", **GREEN, measured=lamp) for lamp in ("A", "LED-B3", "HP1")
    )
    assert same == pytest.approx(0.02)
    assert 0.02 < near < far < 0.08


def test_two_lamps_can_differ_by_more_than_half():
    assert np.expm1(mismatch.find_confusion("green")) == pytest.approx(0.85, abs=0.01)


def test_library_equals_the_published_files():
    for name in mismatch.list_responses():
        path = data_file(f"spectral/{name.replace(' ', '_')}.json")
        stated = json.loads(path.read_text())["spectral_data"]["data"]["main"]
        rows = np.array([stated[str(nm)] for nm in range(380, 781, 5)])
        assert mismatch.read_response(name) == pytest.approx(rows, rel=1e-5, abs=1e-9)


def test_names_and_models():
    assert mismatch.name_curve("cie led-b3", mismatch.list_lamps()) == "LED-B3"
    assert mismatch.find_response("Hasselblad", "L2D-20c") == "Hasselblad L2D-20c"
    assert mismatch.find_response("NIKON CORPORATION", "NIKON D5100") == "Nikon D5100"
    assert mismatch.find_response("DJI", "FC6520") is None


def test_own_table_is_read_in_the_forms_of_spreadsheets():
    german = FLAT.replace(",", ";").replace("400;1", "400;0,5")
    assert mismatch.read_lamp(f"nm;value\n{german}")[4] == pytest.approx(0.5)
    assert mismatch.read_lamp(FLAT.replace(",", "\t"))[5] == pytest.approx(1.0)


@pytest.mark.parametrize(
    "text",
    [
        "HP9",
        "380,1\n780,1",
        FLAT.replace("500,1", "500,x"),
        FLAT.replace("500,1", "500,nan"),
        FLAT.replace("500,1", "500,-1"),
        FLAT.replace("500,1", "300,1"),
        "\n".join(f"{nm},1" for nm in range(450, 651, 10)),
        FLAT.replace(",1", ",0"),
    ],
)
def test_other_tables_are_refused(text):
    with pytest.raises(InputRejected) as refused:
        mismatch.read_lamp(text)
    assert refused.value.code == mismatch.SPECTRUM_INVALID
