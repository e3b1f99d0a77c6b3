"""Two measurements against each other over HTTP."""

import numpy as np
import pytest

from radiometry.spectral.mismatch import compute_mismatch
from service.documents.pages import lay_out
from tests.support.campaigns import K_TRUE, ROI, calibrate, published_campaign
from tests.support.frames import write_frame

SETTINGS = {"exposure_time_s": 0.02, "f_number": 4.0}
PER_DN = 4.0**2 / (K_TRUE * 0.02 * 3200)
GRID = {"corners": [[8, 8], [88, 8], [88, 56], [8, 56]], "rows": 2, "columns": 2}


@pytest.fixture(scope="module")
def version(sqlite_house):
    return published_campaign(sqlite_house, isos=(3200,))


@pytest.fixture
def house(sqlite_house):
    """One for all: nothing here depends on the database."""
    return sqlite_house


def measure(house, version, luminance, name, *, signal=None, **asked):
    campaign = house.campaign()
    house.put(f"/v1/campaigns/{campaign['id']}/roi", ROI)
    signal = luminance / PER_DN if signal is None else signal
    path = write_frame(house.folder / name, signal_dn=signal, seed=len(name), **SETTINGS)
    frame = house.upload(campaign, path.read_bytes(), role="field", filename=name)
    house.work()
    # an exposure of 1/50 s does not flicker at 50 Hz
    return house.measure(frame_id=frame["id"], calibration_id=version["id"], mains_frequency_hz=50.0, **asked)


def test_two_nights_with_one_version_are_compared_better_than_either_is_known(house, version):
    """K, meter, time and f-number cancel in the ratio: noise and dark signal remain."""
    old, new = measure(house, version, 20.0, "a.dng"), measure(house, version, 19.0, "bb.dng")
    address = f"/v1/measurements/{new['id']}/comparison"
    found = house.get(address, old=old["id"], same_light="true")
    assert found["common"] == ["ISO setting", "dark signal", "exposure time", "f-number", "fit of K",
                               "focus distance", "meter calibration", "spectral mismatch",
                               "stray light"]  # fmt: skip
    assert found["difference"]["value"] == pytest.approx(new["mean"]["value"] - old["mean"]["value"])
    change = found["change"]
    assert abs(change["value"] + 5.0) <= 3 * change["standard_uncertainty"]
    relative = old["mean"]["standard_uncertainty"] / old["mean"]["value"]
    assert change["standard_uncertainty"] < 10 * relative
    assert found["significant"]
    assert "fell by 5" in found["said"]
    assert found["same_region"]
    assert "cells" not in found
    same = measure(house, version, 20.0, "dddd.dng")
    found = house.get(f"/v1/measurements/{same['id']}/comparison", old=old["id"], same_light="true")
    assert found["in_standard_uncertainties"] < 4
    assert found["significant"] is (found["in_standard_uncertainties"] >= 2)
    # as far as the service knows, the lamps may be of two types
    unknown = house.get(address, old=old["id"])
    assert not unknown["significant"]
    assert unknown["confusion_rel"] == pytest.approx(0.46, abs=0.01)
    assert unknown["change"]["standard_uncertainty"] == pytest.approx(13.8, abs=0.3)
    assert house.get(address, status=422)["errors"][0]["field"] == "query.old"
    house.get(address, status=404, old="msr_none")


def test_another_version_has_another_k_and_both_count(house, version):
    other = calibrate(house, {"id": version["campaign_id"]}, tolerance=0.03)
    old, new = measure(house, version, 20.0, "e.dng"), measure(house, other, 20.0, "ff.dng")
    found = house.get(f"/v1/measurements/{new['id']}/comparison", old=old["id"])
    assert not {"fit of K", "meter calibration", "dark signal"} & set(found["common"])
    by_k = [row["standard_uncertainty_cd_m2"] for side in (old, new) for row in side["budget"]
            if row["source"] == "fit of K"]  # fmt: skip
    assert found["difference"]["standard_uncertainty"] >= np.hypot(*by_k)


def test_cells_are_compared_one_by_one(house, version):
    half = np.full((64, 96), 20.0 / PER_DN)
    darker = half.copy()
    darker[:32, :48] *= 0.8
    old = measure(house, version, 20.0, "g.dng", signal=half, grid=GRID)
    new = measure(house, version, 20.0, "hh.dng", signal=darker, grid=GRID)
    asked = {"old": old["id"], "same_light": "true"}
    cells = house.get(f"/v1/measurements/{new['id']}/comparison", **asked)["cells"]
    changes = np.array([[cell["change"]["value"] for cell in line] for line in cells])
    assert changes == pytest.approx(np.array([[-20.0, 0.0], [0.0, 0.0]]), abs=0.3)
    # an unknown spectrum scales the difference by 10 %, so that none exceeds ten of its uncertainties
    assert 8 < cells[0][0]["in_standard_uncertainties"] < 10


def test_other_outlines_are_compared_only_if_asked_for(house, version):
    samples = np.full((64, 96), 10.0 / PER_DN)
    samples[:, 48:] *= 2.0
    other = GRID | {"corners": [[56, 8], [88, 8], [88, 56], [56, 56]]}
    old, drawn, new = (
        measure(house, version, 0.0, f"{'j' * (11 + n)}.dng", signal=samples, **asked)
        for n, asked in enumerate(({}, {"grid": GRID}, {"grid": other}))
    )
    address = f"/v1/measurements/{new['id']}/comparison"
    for each, origin in ((old, "campaign"), (drawn, "grid")):
        problem = house.get(address, status=409, old=each["id"])
        assert (problem["code"], f"from the {origin}" in problem["detail"]) == ("regions_differ", True)
    found = house.get(address, old=drawn["id"], other_region="true", same_light="true")
    # the lens scatters one share of the frame's mean, which is another share of each of the two
    assert "stray light" not in found["common"]
    found = house.get(address, old=drawn["id"], other_region="true")
    assert not found["same_region"]
    assert found["said"].endswith(
        "The two regions differ: the change may be one of the place and not of the light."
    )
    # the verdict is of what the cells show
    cells = [cell["change"]["value"] for line in found["cells"] for cell in line]
    assert min(cells) < found["change"]["value"] < max(cells)
    assert found["old"]["region_origin"] == found["new"]["region_origin"] == "grid"


def test_sodium_replaced_by_led_does_not_cancel_its_mismatch(house, version):
    """With no spectrum known both lines count; with both spectra known the change of colour is corrected."""
    campaign = {"id": version["campaign_id"]}
    stated = {"lamp": "A", "camera_response": "Nikon D5100", "focus_distance_m": 1.5, "acceptance": "guarded"}
    house.patch(f"/v1/campaigns/{campaign['id']}", stated)
    named = calibrate(house, campaign)
    certificate = house.get(f"/v1/calibrations/{named['id']}/certificate.json")
    assert certificate["result"]["spectral"] == {
        "lamp": "A", "camera_response": "Nikon D5100", "f1_prime": pytest.approx(0.65, abs=0.006)
    }  # fmt: skip
    assert any("f1' = 65%" in each for each in certificate["statements"])
    assert any("guarded acceptance" in each for each in certificate["statements"])
    assert lay_out(certificate, "")["results"]["rows"][0][-1] == "✗ fails\ntolerance 4 %\nguarded"
    sodium, led = (
        measure(house, named, 20.0, f"{light}.dng", light_source=light) for light in ("HP1", "LED-B3")
    )
    shown = {light: 100 / compute_mismatch("Nikon D5100", channel="green", calibrated="A", measured=light)
             for light in ("HP1", "LED-B3")}  # fmt: skip
    assert sodium["mean"]["value"] / led["mean"]["value"] == pytest.approx(
        shown["LED-B3"] / shown["HP1"], rel=2e-3
    )
    assert {each["source"] for each in sodium["corrections"]} == {
        "spectral mismatch", "focus distance", "stray light"
    }  # fmt: skip
    assert "spectral_mismatch_unknown" not in {each["flag"] for each in sodium["flags"]}
    found = house.get(f"/v1/measurements/{led['id']}/comparison", old=sodium["id"])
    assert "confusion_rel" not in found
    assert "spectral mismatch" not in found["common"]
    by_colour = [row["standard_uncertainty_cd_m2"] for side in (sodium, led) for row in side["budget"]
                 if row["source"] == "spectral mismatch"]  # fmt: skip
    assert found["difference"]["standard_uncertainty"] >= np.hypot(*by_colour)
