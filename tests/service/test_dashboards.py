"""Dashboards elsewhere: allowed origins, a hundred thousand rows at once, the files that docs/ gives away."""

import csv
import json
import re
from dataclasses import replace
from pathlib import Path

import pytest
from sqlalchemy import select
from starlette.testclient import TestClient

from service.http.app import build_app
from store.tables import ReadyCells
from tests.support.campaigns import published_campaign
from tests.support.house import KEY
from tests.support.live import serving
from tests.support.measuring import field_frame, measure

pytestmark = pytest.mark.either_database

DOCS = Path(__file__).parents[2] / "docs"


def measure_once(house):
    version = house.stage(published_campaign, isos=(3200,))
    measure(house, field_frame(house, version["campaign_id"]), version)
    return version


@pytest.fixture
def measured(staged):
    return staged(measure_once)


def test_only_listed_origins_may_read(house):
    settings = house.settings.model_copy(update={"cors_origins": "https://board.example, https://b.example/"})
    context = house.app.state.context
    app = build_app(replace(context, settings=settings))
    asked = {"Access-Control-Request-Method": "GET", "Access-Control-Request-Headers": "authorization"}
    with TestClient(app) as client:
        answer = client.options("/v1/cameras", headers={"Origin": "https://b.example", **asked})
        assert answer.headers["Access-Control-Allow-Origin"] == "https://b.example"
        assert "Access-Control-Allow-Credentials" not in answer.headers
        answer = client.options("/v1/cameras", headers={"Origin": "https://evil.example", **asked})
        assert "Access-Control-Allow-Origin" not in answer.headers
        asked["Access-Control-Request-Method"] = "POST"
        answer = client.options("/v1/cameras", headers={"Origin": "https://b.example", **asked})
        assert answer.status_code == 400
        headers = {"Origin": "https://b.example", "Authorization": f"Bearer {KEY}"}
        answer = client.get("/v1/cameras", headers=headers)
        assert answer.status_code == 200
        shown = set(answer.headers["Access-Control-Expose-Headers"].split(", "))
        assert {"ETag", "Link", "Retry-After", "Content-Disposition"} <= shown


def test_a_hundred_thousand_rows_are_one_answer(house, measured):
    with house.database.writing("test") as session:
        kept = session.scalars(select(ReadyCells)).one()
        before, _, after = kept.cells.splitlines()[-1].partition(
            f",{measured['coefficients'][-1]['value']!r},"
        )
        lines = [f"{before},{30.0 + number!r},{after}" for number in range(100_000)]
        kept.cells = "\n".join([kept.cells, *lines])
    head, *lines = house.http.get("/v1/series/coefficients", params={"format": "csv"}).text.splitlines()
    assert len(lines) == len(measured["coefficients"]) + 100_000
    (last,) = csv.DictReader([head, lines[-1]])
    assert (float(last["value"]), last["valid_from"]) == (30.0 + 99_999, "2026-05-01T00:00:00Z")


def targets_of(dashboard):
    return [target for panel in dashboard["panels"] for target in panel.get("targets", ())]


@pytest.mark.usefixtures("measured")
def test_every_panel_of_the_grafana_dashboard_finds_its_columns(house):
    dashboard = json.loads((DOCS / "grafana-dashboard.json").read_text())
    targets = targets_of(dashboard)
    assert len(targets) >= 4
    for target in targets:
        assert target["datasource"]["type"] == "yesoreyeram-infinity-datasource"
        path = re.sub(r"\$\{__from:date\}", "2026-01-01T00:00:00Z", target["url"])
        path = re.sub(r"\$\{__to:date\}", "2030-01-01T00:00:00Z", path).removeprefix("${url}")
        assert "$" not in path
        rows = house.get(path)
        for step in target["root_selector"].split("."):
            rows = rows[step]
        assert rows, path
        columns = {column["selector"] for column in target["columns"]}
        assert columns <= set().union(*(row.keys() for row in rows)), path


def test_the_notebook_runs(house, measured, capsys, monkeypatch):
    notebook = json.loads((DOCS / "notebook.ipynb").read_text(encoding="utf-8"))
    assert notebook["nbformat"] == 4
    monkeypatch.setenv("STILB_KEY", KEY)
    names: dict = {}
    with serving(house) as live:
        monkeypatch.setenv("STILB_URL", live.url)
        for cell in notebook["cells"]:
            assert not cell.get("outputs")
            if cell["cell_type"] == "code":
                exec(compile("".join(cell["source"]), "notebook", "exec"), names)
        names["client"].close()
    coefficient = next(row for row in measured["coefficients"] if row["name"] == "luminance_k")
    assert f"luminance_k {coefficient['value']:.3f}" in capsys.readouterr().out
