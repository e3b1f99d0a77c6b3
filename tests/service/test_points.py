"""A luminance campaign from a table of statistics, where the pixels are gone."""

import csv
import io
import math

import pytest

from tests.support.campaigns import K_TRUE, LEVELS, ROI, SETTINGS, calibrate, list_readings
from tests.support.certificates import certificate_of, export_version
from tests.support.data import data_file
from tests.support.every_method import begin
from tests.verify.changing import run

pytestmark = pytest.mark.either_database

HEAD = " ,Label,Area,Mean,Min,Max,StdDev,scene,dark,exposure_time,aperture,iso"


def send(house, campaign, text, *, status=201, white_level_dn=4095, **query):
    return house.ask(
        "POST",
        f"/v1/campaigns/{campaign['id']}/points",
        status=status,
        content=text.encode(),
        params={"white_level_dn": white_level_dn, **query},
        headers={"Content-Type": "text/csv"},
    )


def imagej(iso=3200, dark_dn=256.0):
    """The Results of ImageJ for a small campaign, with columns for scene and settings added."""
    rows = [
        (scene, "", time_s, f, dark_dn + K_TRUE * time_s * iso * level / f**2)
        for scene, level in LEVELS.items()
        for time_s, f in SETTINGS
    ]
    rows += [("", "yes", time_s, 4.0, dark_dn) for time_s in (0.01, 0.02, 0.02)]
    lines = [
        f"{n},DSC_{n}.tif,4000,{mean:.3f},{math.floor(mean - 30)},{math.ceil(mean + 30)},8.1,"
        f"{scene},{dark},{t},{f},{iso}"
        for n, (scene, dark, t, f, mean) in enumerate(rows, start=1)
    ]
    return "\n".join([HEAD, *lines]) + "\n"


def read(house, campaign, levels):
    house.post(f"/v1/campaigns/{campaign['id']}/readings", list_readings(levels, factors=(1.0,)))


def test_results_of_imagej_give_k_that_is_verified_without_pixels(house, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "250")
    campaign = house.campaign()
    answer = send(house, campaign, imagej())
    assert len(answer["items"]) == 15
    assert answer["ignored_columns"] == []
    assert send(house, campaign, imagej(), status=200) == answer
    read(house, campaign, LEVELS)
    version = calibrate(house, campaign)
    (k,) = [c for c in version["coefficients"] if c["name"] == "luminance_k" and "f_number" not in c]
    assert k["value"] == pytest.approx(K_TRUE, rel=1e-3)
    certificate = certificate_of(house, version)
    assert "statistics_from_table" in {flag["flag"] for flag in certificate["flags"]}
    assert all("pixels were not seen" in " ".join(frame["warnings"]) for frame in certificate["frames"])
    folder = export_version(house, version, tmp_path / "export")
    code, said = run(capsys, folder)
    assert code == 0
    assert "15 are rows of a table: their pixels were not seen." in said
    job = house.post(
        "/v1/measurements",
        {"frame_id": answer["items"][0]["frame_id"], "calibration_id": version["id"]},
        status=202,
    )
    house.work()
    assert house.get(f"/v1/jobs/{job['id']}")["error"]["code"] == "pixels_missing"


def test_a_nikon_d70_of_which_only_means_were_published(house):
    """Brainard's series: log-log slope of time 1.00 in green; saturated above 16,380 DN."""
    campaign = house.campaign()
    series = list(csv.DictReader(data_file("nikon-d70/exposure_series.csv").read_text().splitlines()))[::3]
    text = io.StringIO()
    table = csv.writer(text)
    table.writerow(["file", "scene", "dark", "exposure_s", "f_number", "mean", "min", "max", "pixels"])

    def write(name, scene, dark, exposure_s, f_number, mean):
        level = [mean, math.floor(mean), math.ceil(mean), 100]
        table.writerow([name, scene, dark, exposure_s, f_number, *level])

    for n, row in enumerate(series):
        at = row["f_number"]
        write(f"light-{n}", f"wall at f/{at}", "", row["exposure_s"], at, float(row["G"]))
    # ten times as bright, as the frames at f/16 and 1/250 s of both show
    bright = csv.DictReader(data_file("nikon-d70/aperture_series_t1_250.csv").read_text().splitlines())
    for n, row in enumerate(bright):
        write(f"bright-{n}", "bright", "", "1/250", row["f_number"], float(row["G"]))
    for n, row in enumerate(csv.reader(data_file("nikon-d70/dark_table.csv").read_text().splitlines())):
        if n and n % 5 == 0:
            write(f"dark-{n}", "", "yes", row[0], 11, float(row[2]))
    send(house, campaign, text.getvalue(), white_level_dn=16380, iso=200)
    read(house, campaign, {f"wall at f/{row['f_number']}": 100.0 for row in series} | {"bright": 1000.0})
    version = calibrate(house, campaign)
    models = {each["model"]: each["parameters"] for each in version["diagnostics"]["iso_fits"][0]["models"]}
    assert models["power"][1] == pytest.approx(1.0, abs=0.01)
    out = {point["frame"]: point["left_out"] for point in version["points"] if "left_out" in point}
    assert {f"bright-{n}" for n in range(5)} <= {name for name, why in out.items() if "saturated" in why}
    assert "dark_varies" in {flag["flag"] for flag in version["diagnostics"]["flags"]}


ROW = "1,a.tif,100,500,400,600,9,level-1,,0.01,4,3200"


def test_a_wrong_table_is_named_by_line_and_column_and_stores_nothing(house):
    campaign = house.campaign()
    for text, named in (
        ("Label,Mean\na,5", "lacks exposure_time_s, f_number, iso, min_dn, max_dn, pixels, scene; it names"),
        (f"{HEAD}\n{ROW.replace(',500,', ',nan,')}", "line 2.mean_dn"),
        (f"{HEAD}\n{ROW.replace(',500,', ',700,')}", "line 2: mean_dn 700 lies outside"),
        (f"{HEAD}\n{ROW.replace(',500,', ',500,5,')}", "line 2: has more cells"),
        (f"{HEAD}\n{ROW}\n{ROW.replace('1,a', '2,a')}", "line 3.filename: names 'a.tif' as line 2"),
        (f"{HEAD}\n{ROW.replace('0.01', '0.01 s')}", "line 2.exposure_time_s"),
        (f"{HEAD}\n{ROW.replace(',100,', ',10.5,')}", "pixels is no whole number"),
        (f"{HEAD}\n{ROW.replace('600', '6000')}", "line 2.max_dn: is above white_level_dn 4095"),
        (f"{HEAD}\n{ROW.replace('level-1', '')}", "line 2: needs a scene"),
        (f"{HEAD}\n{ROW.replace('level-1,,', 'level-1,256.1,')}", "line 2.dark: must be yes or no"),
        (HEAD, "must hold 1 to 1000 points"),
    ):
        assert named in send(house, campaign, text, status=422)["detail"]
    assert house.get(f"/v1/campaigns/{campaign['id']}/frames")["items"] == []


def test_semicolons_come_with_decimal_commas_and_times_may_be_fractions(house):
    campaign = house.campaign()
    row = ROW.replace(",500,", ",500.5,").replace("0.01", "1/125").replace(",", ";").replace(".5", ",5")
    (made,) = send(house, campaign, f"{HEAD.replace(',', ';')}\n{row}")["items"]
    house.work()
    frame = house.get(f"/v1/frames/{made['frame_id']}")
    house.put(f"/v1/campaigns/{campaign['id']}/roi", ROI)
    assert (frame["exposure_time_s"], frame["statistics"][0]["mean_dn"]) == (1 / 125, 500.5)
    problem = send(house, campaign, f"{HEAD}\n{ROW}", status=422)
    assert "line 2.filename: the campaign has a.tif with other values" in problem["detail"]


def test_another_method_needs_pixels(house):
    campaign = begin(house, "noise", {})
    assert send(house, campaign, f"{HEAD}\n{ROW}", status=422)["code"] == "pixels_missing"
