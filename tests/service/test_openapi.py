"""The published document keeps the contract's rules, for every route there is."""

import itertools
import json
import re
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier

import pytest
from jsonschema import Draft202012Validator
from pydantic import ValidationError

import service.http.document
from service.calibrations.methods import describe_versions
from service.campaigns.schemas import NewReading, NewRoi
from service.equipment.routes import NewRig
from service.http.document import resolve
from service.measurements.requests import NewGrid, read_roi
from service.pages.documentation import render_markdown
from service.tools.routes import NewMotion
from store.software import read_version

JSON, PROBLEM = "application/json", "application/problem+json"
NUMBERS_WITHOUT_UNIT = {
    # their unit stands beside them
    *("value", "standard_uncertainty", "expanded_uncertainty", "entered_value"),
    *("iso", "f_number", "coverage_factor", "progress", "tolerance", "surface_reflectance"),
    # of a road's criteria, model and scale
    *("maintenance_factor", "without_it", "at_least", "at_most", "needed_u", "probability", "sigma"),
    *("expected_u", "factor_u", "slope", "slope_u", "unlike"),
    *("in_standard_uncertainties", "horizontal", "vertical"),  # the last two in fov_deg
    # of a sensor's own unit, which stands beside them
    *("i_sq", "i_sq_standard_uncertainty", "i_ss", "i_ss_oriented", "reflectance_k", "shared_u", "noise_u"),
    *(
        "diffuse_share",
        "diffuse_share_u",
        "refractive_index",
        "below_zero_share",
        "above_one_share",
        "signal_share",
        "centre_x_share",
    ),
    *("seen_share", "star_contrast", "gain_range_share"),
    *("minimum", "maximum"),  # of a parameter, whose unit stands beside them
    "centre_y_share",
    *("pixels", "below_zero", "above_one", "saturated", "undefined"),
    *("saturated_share", "zero_share", "variance_share", "reflectance"),
    *("f_statistic", "f_p_value", "equivalence_p_value", "exceedance_p_value", "slope_p_value"),
    *("u_constant", "u_pixel"),  # of a map, whose unit stands beside them
    *("common_uncertainty", "own_uncertainty", "low", "high", "smallest", "largest", "level"),  # likewise
    *("min_to_max", "share", "unknown_share"),
    *("lamp_modulation", "glare_share", "factor"),
    "limit",  # of a tolerance, whose unit stands beside it
    *("u_o", "average_to_min", "max_to_min", "index_value", "effective_dof"),
}
UNIT = re.compile(r"_(s|hz|km_h|um|mm|px|dn|rel|deg|m|w|cd_m2|bytes|lx|reflectance)$")


@pytest.fixture(scope="module")
def document(built_app):
    return built_app.openapi()


@pytest.fixture(scope="module")
def operations(document):
    return [
        (f"{method.upper()} {path}", operation | {"responses": resolve_each(document, operation)})
        for path, methods in document["paths"].items()
        for method, operation in methods.items()
    ]


def resolve_each(document, operation):
    return {status: resolve(document, answer) for status, answer in operation["responses"].items()}


def test_document_states_the_version_of_the_product(document):
    assert document["info"]["version"] == read_version()


def media_of(operation):
    """Every body that is sent or answered: (status or None, content type, media object)."""
    body = operation.get("requestBody", {})
    for kind, media in {**body.get("content", {}), **body.get("x-also-accepts", {})}.items():
        yield None, kind, media
    for status, answer in operation["responses"].items():
        for kind, media in answer.get("content", {}).items():
            yield int(status), kind, media


def test_the_first_requests_may_all_come_at_once(built_app):
    """A page of ours asks for six things before it has any of them."""
    built_app.openapi_schema = None
    together = Barrier(4)

    def ask(_):
        together.wait()
        return built_app.openapi()

    with ThreadPoolExecutor(4) as pool:
        assert len({id(document) for document in pool.map(ask, range(4))}) == 1


def test_every_route_has_an_id_of_its_own_and_a_summary(operations):
    ids = [operation["operationId"] for _, operation in operations]
    assert len(ids) == len(set(ids)) > 25
    assert all(re.fullmatch(r"[a-z]+(_[a-z]+)+", each) for each in ids)
    summaries = [operation["summary"] for _, operation in operations]
    assert all(6 < len(each) < 120 and not each.endswith(".") for each in summaries)
    # a title made of the function's name says nothing new
    assert not [s for s, i in zip(summaries, ids, strict=True) if s.lower() == i.replace("_", " ")]


def test_a_client_generator_keeps_every_schema_and_operation(document, operations):
    """openapi-python-client drops schemas of one title, all that uses them, and operations that take CSV.

    It knows no type of an object that has alternatives beside its properties.
    """
    titles = Counter(each.get("title") for each in document["components"]["schemas"].values())
    assert {title for title, count in titles.items() if title and count > 1} == set()
    kinds = {name: {*operation.get("requestBody", {}).get("content", {})} for name, operation in operations}
    raw = "POST /v1/campaigns/{campaign_id}/frames"
    assert [name for name, each in kinds.items() if len(each) > 1] == [raw]
    assert [name for name, each in kinds.items() if "text/csv" in each] == []
    alternatives = {"oneOf", "anyOf"}
    schemas = document["components"]["schemas"]
    assert [name for name, each in schemas.items() if "properties" in each and alternatives & {*each}] == []
    assert schemas["JobAnswer"]["properties"]["created_at"]["format"] == "date-time"


def test_every_json_body_has_an_example_that_validates(document, operations):
    for name, operation in operations:
        for status, kind, media in media_of(operation):
            if kind not in {JSON, PROBLEM}:
                continue
            assert "example" in media, (name, status)
            schema = {**media["schema"], "components": document["components"]}
            errors = list(Draft202012Validator(schema).iter_errors(media["example"]))
            assert not errors, (name, status, errors[0].message)


def test_the_schema_refuses_what_the_form_refuses(document):
    """Fields that exclude each other, years, calls of a macro and what stands once."""
    motion = {"pixel_pitch_um": 4, "focal_length_mm": 35, "exposure_time_s": 0.01, "distance_m": 9}
    reading = {"scene": "s", "quantity": "luminance", "value": 1, "unit": "cd/m²"}
    corners = [[0, 0], [9, 0], [9, 9], [0, 9]]
    lanes = {"lanes": 2.0, "lane_width_m": 3, "spacing_m": 30}
    cases = [
        (NewMotion, motion | {"ground_speed_m_s": 5}, {"ground_speed_km_h": 18}),
        (NewReading, reading | {"taken_at": "1900-01-01T00:00:00Z"}, {"unit": "lx"}),
        (NewReading, reading | {"quantity": "illuminance", "unit": "fc"}, {"unit": "fL"}),
        (NewReading, reading | {"taken_at": "9000-12-31T00:00:00Z"}, {"taken_at": "9001-01-01T00:00:00Z"}),
        (NewReading, reading, {"taken_at": "1899-12-31T23:59:59Z"}),
        (NewGrid, {"corners": corners} | lanes, {"rows": 2}),
        (NewGrid, {"corners": corners, "rows": 2.0, "columns": 3}, {"lanes": 2}),
        (NewRig, {"name": "r", "camera_ids": ["a", "b"]}, {"camera_ids": ["a", "a"]}),
    ]
    for form, body, change in cases:
        schema = Draft202012Validator({**document["components"]["schemas"][form.__name__], **document})
        assert schema.is_valid(body), body
        form.model_validate(body)
        assert not schema.is_valid(body | change), change
        with pytest.raises(ValidationError):
            form.model_validate(body | change)
    call, region = (re.compile(pattern) for pattern in find_region_patterns(document))
    for text in ("makePolygon(10,10,90,10,90,60)", " makeRectangle (-1, 1e1,80.5,.5) ;\n"):
        read_roi(NewRoi(imagej=text))
        assert call.search(text)
        assert region.search(text)
    assert region.search("[[0, 0],[9,0], [9,9.5e0]]")
    assert not any(region.search(text) for text in ("makePolygon(1,2,3,4)", "[[0,0],[9,0],[9,+9]]", "9"))


def find_region_patterns(document):
    schemas, upload = document["components"]["schemas"], "/v1/campaigns/{campaign_id}/frames"
    yield schemas["NewRoi"]["properties"]["imagej"]["pattern"]
    parameters = document["paths"][upload]["post"]["parameters"]
    yield next(each["schema"]["pattern"] for each in parameters if each["name"] == "roi")


def test_recorded_examples_hold_the_fields_of_today(document):
    """`make examples` records them: no schema, field or type of theirs may be of an older service."""
    recorded = json.loads(Path(service.http.document.__file__).with_name("examples.json").read_text("utf-8"))
    written_out = {"NewCoverage", "NewExposureSeries", "NewMotion", "NewReading"}
    assert recorded.keys() <= document["components"]["schemas"].keys() | written_out
    exact = {
        name: {"additionalProperties": False, **schema} if "properties" in schema else schema
        for name, schema in document["components"]["schemas"].items()
    }
    for name in recorded.keys() - written_out:
        errors = Draft202012Validator({**exact[name], "components": {"schemas": exact}})
        assert not [error.message for error in errors.iter_errors(recorded[name])], name


def test_an_error_is_a_problem_and_its_example_is_of_its_status(operations):
    for name, operation in operations:
        for status, kind, media in media_of(operation):
            if status is not None and status >= 400:
                assert kind == PROBLEM, (name, status)
                assert media["example"]["status"] == status, name


def test_what_can_go_wrong_is_documented(operations):
    for name, operation in operations:
        statuses = set(map(int, operation["responses"]))
        if operation["security"]:
            assert {401, 403, 422, 503} <= statuses, name
        if "{" in name:
            assert 404 in statuses, name
        if "requestBody" in operation:
            assert {400, 413, 415} <= statuses, name


def test_headers_and_links_are_stated(document):
    begin = resolve_each(document, document["paths"]["/v1/measurements"]["post"])
    assert {"Location"} <= begin["202"]["headers"].keys()
    assert begin["202"]["links"]["get_job"]["operationId"] == "get_job"
    assert "Retry-After" in begin["503"]["headers"]
    assert (
        "ETag" in document["paths"]["/v1/measurements/{measurement_id}"]["get"]["responses"]["200"]["headers"]
    )


def test_every_route_but_those_for_machines_needs_a_key(operations):
    without = {name for name, operation in operations if not operation["security"]}
    by_capability = {f"{method} /v1/uploads/{{upload_id}}" for method in ("HEAD", "PATCH", "DELETE")}
    machines = {"GET /livez", "GET /readyz", "GET /metrics", "OPTIONS /v1/uploads", "GET /v1/signing-keys"}
    assert without == machines | by_capability


def test_every_post_takes_an_idempotency_key(operations):
    for name, operation in operations:
        if name.startswith("POST"):
            assert "Idempotency-Key" in {p["name"] for p in operation["parameters"]}, name


def nodes(node, path=()):
    if isinstance(node, dict):
        yield path, node
        for key, member in node.items():
            if key not in {"example", "examples"}:
                yield from nodes(member, (*path, key))
    if isinstance(node, list):
        for index, member in enumerate(node):
            yield from nodes(member, (*path, index))


def test_absence_is_not_null(document):
    for path, node in nodes(document):
        options = node.get("anyOf", []) if isinstance(node.get("anyOf", []), list) else []
        if {"type": "null"} in options:
            # a page without a next, a feature without a place; a table has all its columns in every row
            assert path[-1] in {"next", "geometry"} or {"SeriesRow", "MeasurementSeriesRow"} & {*path}, path
        assert "nullable_on_purpose" not in node, path


def test_a_discriminator_has_no_default(document):
    for path, node in nodes(document):
        name = node["discriminator"]["propertyName"] if isinstance(node.get("discriminator"), dict) else None
        for option in [*node.get("oneOf", []), *node.get("anyOf", [])] if name else []:
            assert "default" not in resolve(document, option)["properties"][name], path


def test_a_number_says_its_unit_in_its_name(document):
    stored, _ = describe_versions()
    for name, schema in document["components"]["schemas"].items():
        for field, kind in schema.get("properties", {}).items():
            if kind.get("type") == "number" and name not in stored:
                stem = field.removesuffix("_standard_uncertainty")
                assert UNIT.search(stem) or stem in NUMBERS_WITHOUT_UNIT, (name, field)


def test_a_form_says_that_it_takes_no_other_fields(document, operations):
    for name, operation in operations:
        media = operation.get("requestBody", {}).get("content", {}).get(JSON)
        if media is not None and "$ref" in media["schema"]:
            schema = resolve(document, media["schema"])
            for form in [schema] if "properties" in schema else schema["anyOf"]:
                assert resolve(document, form)["additionalProperties"] is False, name


def test_the_reference_shows_every_route_and_loads_nothing(open_http, document):
    page = open_http.get("/docs")
    assert page.headers["content-type"] == "text/html; charset=utf-8"
    for path in document["paths"]:
        assert f" {path}</code>" in page.text
    assert not re.search(r"<script|(src|href)=[\"']?(https?:)?//|@import|url\(", page.text)
    assert "default-src 'none'" in page.headers["content-security-policy"]
    pages = {path.name: render_markdown(path.read_text("utf-8")) for path in Path("docs").glob("*.md")}
    for name, html in {"reference": page.text, **pages}.items():
        levels = [int(level) for level in re.findall(r"<h([1-6])", html)]
        assert levels.count(1) == 1, name
        assert all(below <= above + 1 for above, below in itertools.pairwise(levels)), name


def test_the_requests_that_pages_print_are_those_of_the_document(document):
    known = {re.sub(r"\{\w+\}", "{id}", path): methods for path, methods in document["paths"].items()}
    found = 0
    for page in sorted(Path("docs").glob("*.md")):
        text = page.read_text("utf-8")
        for line in re.finditer(
            r"^    (GET|POST|PUT|PATCH|DELETE) +(/v1/[^\s?]+)(?:\?(\w+)=\S+)? *", text, re.MULTILINE
        ):
            method, path, parameter = line.groups()
            operation, found = known[path][method.lower()], found + 1
            names = {each["name"] for each in operation.get("parameters", ())}
            assert parameter is None or parameter in names, (page.name, line[0])
            if text[line.end()] == "{":
                body, _ = json.JSONDecoder().raw_decode(text, line.end())
                schema = operation["requestBody"]["content"][JSON]["schema"]
                whole = {"components": document["components"], **schema}
                faults = [each.message for each in Draft202012Validator(whole).iter_errors(body)]
                assert faults == [], (page.name, line[0])
    assert found > 10


def test_the_type_of_a_problem_leads_to_its_explanation(open_http, monkeypatch, tmp_path):
    address, _, place = open_http.get("/v1/nothing").json()["type"].partition("#")
    assert f'id="{place}"' in open_http.get(address).text
    page = tmp_path / "errors.md"
    page.write_text(
        "# Errors\n\n## not_found\n\nThere is <script>no</script> such thing.\n", encoding="utf-8"
    )
    monkeypatch.setattr("service.pages.documentation._MANUAL", tmp_path)
    html = open_http.get(address).text
    assert f'<h2 id="{place}">not_found</h2>' in html
    assert "<script>" not in html
