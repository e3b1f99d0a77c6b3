"""From a camera to its coefficients in force, the way a client goes."""

import csv
import io
import math
import xml.etree.ElementTree as ET

import pytest

from store.logs import add_fields
from store.tables import Blob
from tests.support.campaigns import ISOS, K_TRUE, LEVELS, calibrate, calibrated_campaign, upload_campaign

pytestmark = pytest.mark.either_database


def test_a_campaign_becomes_coefficients_in_force(house, caplog):
    campaign = upload_campaign(house)
    caplog.handler.addFilter(add_fields)
    with caplog.at_level("INFO"):
        version = calibrate(house, campaign)
    # in the logs an id leads from a request to its job, and from there to its version
    told = [record.fields for record in caplog.records if "duration_s" in record.fields]
    (job,) = (each for each in told if each.get("calibration_id") == version["id"])
    assert (job["kind"], job["state"], job["subject_id"]) == ("fit", "succeeded", campaign["id"])
    (request,) = (each for each in told if each.get("jobs") == [job["job_id"]])
    assert request["route"] == "/v1/campaigns/{campaign_id}/calibrations"
    assert request["request_id"].startswith("req_")
    assert version["state"] == "draft"
    assert version["version"] == 1
    ks = [c for c in version["coefficients"] if c["name"] == "luminance_k"]
    assert [c["iso"] for c in ks if "f_number" not in c] == list(ISOS)
    assert [(c["iso"], c["f_number"]) for c in ks if "f_number" in c] == [
        (iso, f_number) for iso in ISOS for f_number in (4.0, 5.6)
    ]
    for k in ks:
        assert abs(k["value"] - K_TRUE) <= 3 * k["standard_uncertainty"]
        assert k["unit"] == "DN*m2/(cd*s)"
    camera = version["camera_id"]
    house.get(f"/v1/cameras/{camera}/coefficients", method="luminance", status=404)
    assert house.publish(version)["state"] == "published"
    items = house.get(
        f"/v1/cameras/{camera}/coefficients", method="luminance", iso=3200, at="2026-06-01T00:00:00Z"
    )["items"]
    assert [i["name"] for i in items] == ["luminance_k", "dark_signal_dn"]
    assert items[0]["value"] == ks[0]["value"]
    stated = house.get(f"/v1/calibrations/{version['id']}/certificate.json")["coefficients"]
    rows = house.get("/v1/series/coefficients")["rows"]
    for name in ("effective_dof", "coverage_factor", "expanded_uncertainty"):
        assert items[0].get(name) == stated[0].get(name) == rows[0][name]
    path = f"/v1/cameras/{camera}/coefficients"
    wanted = {"method": "luminance", "iso": 3200, "name": "luminance_k", "at": "2026-06-01T00:00:00Z"}
    (there,) = house.get(path, f_number=5.6, **wanted)["items"]
    assert (there["f_number"], there["value"], there["flags"]) == (5.6, ks[3]["value"], ks[3]["flags"])
    (elsewhere,) = house.get(path, f_number=5.0, **wanted)["items"]
    assert elsewhere["value"] == ks[0]["value"]
    assert "f_number_not_calibrated" in elsewhere["flags"]
    u_f_rel = version["diagnostics"]["iso_fits"][0]["coefficient"]["f_number_u_rel"]
    assert elsewhere["standard_uncertainty"] == pytest.approx(
        math.hypot(ks[0]["standard_uncertainty"], 2 * u_f_rel * ks[0]["value"])
    )
    if "expanded_uncertainty" in stated[0]:
        assert elsewhere["effective_dof"] > stated[0]["effective_dof"]
        expanded = elsewhere["coverage_factor"] * elsewhere["standard_uncertainty"]
        assert elsewhere["expanded_uncertainty"] == pytest.approx(expanded)
    assert "version 1 is in force from 2026-05-01T00:00:00Z on" in items[0]["why"]


def test_no_version_in_force_is_never_the_nearest(house, staged):
    version = staged(calibrated_campaign, isos=(3200,))
    turned = house.publish(version, valid_to="2026-04-30T00:00:00Z", status=422)
    assert "valid_to must lie after valid_from" in turned["detail"]
    house.publish(version, valid_to="2026-06-01T00:00:00Z")
    path = f"/v1/cameras/{version['camera_id']}/coefficients"
    assert house.get(path, method="luminance", at="2026-05-31T23:59:59Z")["items"]
    for at in ("2026-06-01T00:00:00Z", "2026-04-30T23:59:59Z"):
        problem = house.get(path, method="luminance", at=at, status=404)
        assert problem["code"] == "no_calibration_in_force"
    other = house.get(path, method="luminance", iso=100, at="2026-05-02T00:00:00Z", status=404)
    assert "ISO 3200" in other["detail"]


def test_what_is_missing_is_said_by_name_before_a_fit(house):
    campaign = house.campaign()
    for seed, scene in enumerate(LEVELS):
        house.upload(campaign, house.frame_bytes(seed=seed), role="light", scene=scene)
    answer = house.post(f"/v1/campaigns/{campaign['id']}/calibrations", {}, status=422)
    assert answer["code"] == "campaign_incomplete"
    assert answer["retryable"]
    frames = house.get(f"/v1/campaigns/{campaign['id']}")["frames"]
    assert frames["being_read"] == frames["received"]
    house.work()
    assert house.get(f"/v1/campaigns/{campaign['id']}")["frames"]["being_read"] == 0
    answer = house.post(f"/v1/campaigns/{campaign['id']}/calibrations", {}, status=422)
    assert not answer["retryable"]
    missing = house.get(f"/v1/campaigns/{campaign['id']}")["missing"]
    assert "scenes level-1 to level-4 have no luminance reading" in missing
    assert house.get("/v1/jobs", kind="fit")["items"] == []


def test_points_and_plot_of_a_version(house, staged, monkeypatch):
    version = staged(calibrated_campaign, isos=(3200,))
    answer = house.http.get(f"/v1/calibrations/{version['id']}/points.csv")
    rows = list(csv.DictReader(io.StringIO(answer.text)))
    assert len(rows) == len(version["points"])
    assert float(rows[0]["rhs"]) == version["points"][0]["rhs"]
    assert all(int(row["min_dn"]) < float(row["signal_dn"]) < int(row["max_dn"]) for row in rows)
    plot = house.http.get(f"/v1/calibrations/{version['id']}/plot.svg")
    drawn = ET.fromstring(plot.text)
    used = sum(1 for p in version["points"] if p["used"])
    points = [
        e for e in drawn.iter() if e.get("class", "").startswith("point s") and e.find("{*}title") is not None
    ]
    # against X, in logarithms, and the residuals
    assert len(points) == 3 * used
    # it is kept as a file, and not drawn again
    monkeypatch.setattr("service.documents.rendered.render_apart", None)
    assert house.http.get(f"/v1/calibrations/{version['id']}/plot.svg").content == plot.content
    with house.database.reading() as session:
        assert session.get(Blob, plot.headers["etag"].strip('"')).size_bytes == len(plot.content)
    again = house.http.get(
        f"/v1/calibrations/{version['id']}/plot.svg", headers={"If-None-Match": plot.headers["etag"]}
    )
    assert (again.status_code, again.content) == (304, b"")
