"""What the service tells those who watch it."""

import json
import re
import shutil
from datetime import timedelta

import pytest
import yaml
from prometheus_client.parser import text_string_to_metric_families
from sqlalchemy import update

from radiometry.methods.findings import FINDINGS
from store import jobs
from store.jobs import Dependency
from store.jobs.processes import Presence
from store.software import read_version
from store.tables import Job, utc_now
from tests.support.compose import ROOT
from worker.upkeep import mend_times

pytestmark = pytest.mark.either_database


def test_metrics_count_what_the_database_holds(house):
    campaign = house.campaign()
    house.upload(campaign, b"no raw file", role="light")
    lines = house.http.get("/metrics").text.splitlines()
    assert 'stilb_jobs{state="queued"} 1.0' in lines
    assert 'stilb_frames{state="received"} 1.0' in lines
    age = next(line for line in lines if line.startswith("stilb_oldest_queued_job_age_seconds "))
    assert float(age.split()[1]) > 0
    assert "stilb_jobs_due_later 0.0" in lines
    with house.database.writing("test") as session:
        later = utc_now() + timedelta(hours=1)
        session.execute(update(Job).values(due_at=later))
    lines = house.http.get("/metrics").text.splitlines()
    assert "stilb_jobs_due_later 1.0" in lines
    assert "stilb_oldest_queued_job_age_seconds 0.0" in lines
    with house.database.writing("test") as session:
        mend_times(session, lease_s=30.0, jumped=False)
    assert "stilb_jobs_due_later 0.0" in house.http.get("/metrics").text.splitlines()
    house.work()
    lines = house.http.get("/metrics").text.splitlines()
    assert 'stilb_jobs{state="failed"} 1.0' in lines
    assert 'stilb_frames{state="refused"} 1.0' in lines
    assert 'stilb_refusals{code="not_a_raw_file"} 1.0' in lines
    assert "stilb_uploads 1.0" in lines
    assert "stilb_oldest_queued_job_age_seconds 0.0" in lines
    assert "stilb_versions_published 0.0" in lines


def test_metrics_tell_who_works_and_who_hangs(house):
    Presence(house.database, "worker").beat()
    Presence(house.database, "worker").beat(worked_s_ago=60.0)
    lines = house.http.get("/metrics").text.splitlines()
    assert 'stilb_parts{kind="worker",state="working"} 1.0' in lines
    assert 'stilb_parts{kind="worker",state="hung"} 1.0' in lines
    assert 'stilb_parts{kind="service",state="gone"} 0.0' in lines


def test_metrics_tell_the_version_and_the_room_on_the_disk(house):
    lines = house.http.get("/metrics").text.splitlines()
    assert f'stilb_info{{version="{read_version()}"}} 1.0' in lines
    (free,) = [line for line in lines if line.startswith("stilb_data_free_bytes ")]
    assert float(free.split()[1]) == pytest.approx(shutil.disk_usage(house.folder).free, rel=0.2)


def test_metrics_tell_why_jobs_were_given_up_and_what_others_wait_for(house):
    campaign = house.campaign()
    for content in (b"no raw file", b"none either", b"none at all"):
        house.upload(campaign, content, role="light")
    for number in range(2):
        with house.database.writing("test") as session:
            claim = jobs.begin(session, house.next_job(), lease_s=30.0)
            if not number:
                jobs.fail(session, claim, {"code": "worker_lost", "detail": "x", "retryable": False})
            else:
                jobs.retry_later(session, claim, waits_for=Dependency.BLOBS)
    Presence(house.database, "worker", away={"blobs": "2026-05-01T00:00:00+00:00"}).beat()
    lines = house.http.get("/metrics").text.splitlines()
    assert 'stilb_jobs_failed{code="worker_lost"} 1.0' in lines
    assert 'stilb_jobs_waiting_for{dependency="blobs"} 1.0' in lines
    assert 'stilb_jobs_waiting_for{dependency="decoder"} 0.0' in lines
    assert 'stilb_workers_without{dependency="blobs"} 1.0' in lines
    assert 'stilb_workers_without{dependency="database"} 0.0' in lines


def test_alerts_and_dashboard_rest_on_what_the_metrics_tell(house):
    """Names of metrics and labels, and the codes, states and kinds that the expressions choose."""
    house.campaign()
    Presence(house.database, "worker", job_seconds=house.worker.durations.found).beat()
    told: dict[str, dict[str, set[str]]] = {}
    for family in text_string_to_metric_families(house.http.get("/metrics").text):
        found = {
            label: {s.labels.get(label) for s in family.samples} for s in family.samples for label in s.labels
        }
        told |= dict.fromkeys({family.name, *(sample.name for sample in family.samples)}, found)
    (group,) = yaml.safe_load((ROOT / "docs/prometheus-rules.yml").read_text(encoding="utf-8"))["groups"]
    assert all(rule["annotations"]["summary"] for rule in group["rules"])
    panels = json.loads((ROOT / "docs/grafana-operations.json").read_text(encoding="utf-8"))["panels"]
    targets = [target for panel in panels for target in panel["targets"]]
    for expr in (each["expr"] for each in (*group["rules"], *targets)):
        check_expression(expr, told)
    legends = {word for each in targets for word in re.findall(r"{{(\w+)}}", each["legendFormat"])}
    assert legends <= {"code"}.union(*told.values())
    assert len({(panel["gridPos"]["x"], panel["gridPos"]["y"]) for panel in panels}) == len(panels)


def check_expression(expr, told):
    chosen = re.findall(r"(stilb_\w+)(?:{([^}]*)})?", expr)
    assert chosen, expr
    assert {name for name, _ in chosen} <= told.keys(), expr
    for name, matchers in chosen:
        for label, values in re.findall(r'(\w+)(?:=~|!~|=)"([^"]*)"', matchers):
            assert label in {"code", *told[name]}, expr
            if label in {"state", "kind"}:
                assert set(values.split("|")) <= told[name][label], expr
            assert label != "code" or {*values.split("|")} <= FINDINGS.keys()
    for labels in re.findall(r"by \(([^)]*)\)", expr):
        assert set(labels.split(", ")) <= {"le", "code"}.union(*(told[name] for name, _ in chosen)), expr


def test_the_level_of_the_decoders_sandbox_is_told(house):
    Presence(house.database, "worker", decoder_sandbox={"level": "seccomp only", "seccomp": True}).beat()
    assert 'stilb_worker_sandbox{level="seccomp only"} 1.0' in house.http.get("/metrics").text.splitlines()


def read_samples(house, name):
    families = text_string_to_metric_families(house.http.get("/metrics").text)
    return {
        (sample.name.removeprefix(name), *sample.labels.values()): sample.value
        for family in families
        if family.name == name
        for sample in family.samples
    }


def test_requests_are_timed_by_route_not_by_address(house):
    camera = house.camera()["id"]
    house.get(f"/v1/cameras/{camera}")
    house.get(f"/v1/cameras/{camera}")
    house.get("/v1/cameras/cam_none", status=404)
    house.http.get("/nowhere")
    answered = read_samples(house, "stilb_requests")
    assert answered["_total", "GET", "/v1/cameras/{camera_id}", "200"] == 2
    assert answered["_total", "GET", "/v1/cameras/{camera_id}", "404"] == 1
    assert answered["_total", "GET", "none", "404"] == 1
    timed = read_samples(house, "stilb_request_duration_seconds")
    assert timed["_count", "GET", "/v1/cameras/{camera_id}"] == 3
    assert timed["_sum", "GET", "/v1/cameras/{camera_id}"] > 0


def test_wrong_keys_are_counted(house):
    with house.with_key("nobody") as wrong:
        wrong.get("/v1/cameras")
        wrong.post("/sign-in", data={"key": "nobody"})
        del wrong.headers["Authorization"]
        wrong.get("/v1/cameras")
    assert read_samples(house, "stilb_wrong_keys") == {("_total",): 2}


def test_metrics_and_details_are_the_operators_where_the_settings_say_so(house, monkeypatch, caplog):
    founded = house.post("/v1/organisations", {"name": "Another City"})
    context = house.app.state.context
    monkeypatch.setitem(
        context.__dict__, "settings", house.settings.model_copy(update={"health_for": "operator"})
    )
    with house.with_key(founded["key"]["secret"]) as other, house.with_key("nobody") as wrong:
        assert [http.get("/metrics").status_code for http in (house.http, other, wrong)] == [200, 403, 401]
        assert [http.get("/readyz").status_code for http in (house.http, other, wrong)] == [200, 403, 401]
        assert "parts" in house.get("/readyz")
        del wrong.headers["Authorization"]
        caplog.set_level("INFO")
        assert wrong.get("/metrics").status_code == 401
        assert wrong.get("/readyz").json() == {"status": "degraded"}
        told = [record.fields["address"] for record in caplog.records if record.message == "request"]
        assert told == ["testclient"]
        monkeypatch.setattr(context.traffic, "stopping", True)
        assert wrong.get("/readyz").status_code == 503


def test_no_client_makes_series_without_bound(house):
    """Paths, methods, names and organisations of the clients' own add no series after the first."""
    counts = []
    for number in range(3):
        own = f"own{number}"
        for method in ("GET", "PUT", own.upper()):
            house.http.request(method, f"/{own}")
            house.http.request(method, f"/v1/frames/{own}")
            house.http.request(method, f"/v1/jobs?kind={own}")
        house.post("/v1/organisations", {"name": own})
        campaign = house.campaign(camera_id=house.camera(serial=own)["id"], project_number=own)
        house.upload(campaign, own.encode(), role="light", scene=own)
        house.work()
        counts.append(len(house.http.get("/metrics").text.splitlines()))
    assert counts[0] < counts[1] == counts[2]  # the first answer does not count itself


def test_jobs_are_timed_by_kind_and_worker(house):
    campaign = house.campaign()
    house.upload(campaign, b"no raw file", role="light")
    house.work()
    Presence(house.database, "worker", job_seconds=house.worker.durations.found).beat()
    samples = read_samples(house, "stilb_job_duration_seconds")
    (part,) = {key[2] for key in samples if key[:2] == ("_count", "extract")}
    assert samples["_count", "extract", part] == samples["_bucket", "extract", "+Inf", part] == 1
    assert samples["_bucket", "extract", "1800.0", part] == 1
    assert samples["_sum", "extract", part] > 0
    assert samples["_count", "fit", part] == 0


def test_whole_tables_are_counted_once_a_minute(house):
    metrics = house.app.state.context.traffic.metrics
    metrics.totals_every_s = 60.0
    house.http.get("/metrics")
    campaign = house.campaign()
    house.upload(campaign, b"no raw file", role="light")
    lines = house.http.get("/metrics").text.splitlines()
    assert "stilb_uploads 0.0" in lines
    assert 'stilb_jobs{state="queued"} 1.0' in lines
    metrics.totals_every_s = 0.0
    assert "stilb_uploads 1.0" in house.http.get("/metrics").text.splitlines()
