"""What schemathesis makes of the published document: every route answers as it says, whatever is sent."""

import pytest
import schemathesis
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from schemathesis.generation import GenerationMode
from schemathesis.specs.openapi import checks

from tests.support.campaigns import calibrate, upload_campaign
from tests.support.house import KEY

CHECKS = [
    schemathesis.checks.not_a_server_error,
    checks.status_code_conformance,
    checks.content_type_conformance,
    checks.response_headers_conformance,
    checks.response_schema_conformance,
    checks.negative_data_rejection,
]
EXAMPLES = 20


@pytest.fixture
def known(house):
    """Ids that exist, so that not every request ends in 404."""
    campaign = upload_campaign(house, isos=(3200,))
    version = calibrate(house, campaign)
    house.post(
        f"/v1/calibrations/{version['id']}/publish",
        {"valid_from": "2026-05-01T00:00:00Z", "reason": "first"},
        status=200,
    )
    frame_id = version["points"][0]["frame_id"]
    house.post("/v1/measurements", {"frame_id": frame_id, "calibration_id": version["id"]}, status=202)
    house.work()
    spare = house.post("/v1/keys", {"name": "spare", "scopes": ["read"]})
    return {
        "campaign_id": campaign["id"],
        "camera_id": campaign["camera_id"],
        "calibration_id": version["id"],
        "frame_id": frame_id,
        "measurement_id": house.get("/v1/measurements")["items"][0]["id"],
        "job_id": house.get("/v1/jobs")["items"][0]["id"],
        "reading_id": house.get(f"/v1/campaigns/{campaign['id']}/readings")["items"][0]["id"],
        "meter_id": house.post(
            "/v1/meters", {"kind": "luminance", "make": "Gossen", "model": "Starlite", "serial": "1"}
        )["id"],
        "key_id": spare["id"],
        "purge_id": house.post("/v1/purges", {"cause": {"recorder": "A. Meier"}, "reason": "r"})["id"],
    }


def test_every_route_answers_as_the_document_says(house, known):
    schema = schemathesis.openapi.from_asgi("/openapi.json", house.app)
    # the key goes with every request below; what happens without one is told in test_keys.py
    schema.config.generation.with_security_parameters = False
    for result in schema.get_all_operations():
        operation = result.ok()
        named = {p.name: known[p.name] for p in operation.path_parameters}
        strategies = [
            operation.as_strategy(mode, path_parameters=ids)
            for mode in GenerationMode
            for ids in ([named, None] if named else [None])
        ]

        @settings(
            max_examples=EXAMPLES,
            derandomize=True,
            database=None,
            deadline=None,
            phases=[Phase.generate],
            suppress_health_check=list(HealthCheck),
        )
        @given(case=st.one_of(strategies))
        def check(case):
            case.call_and_validate(checks=CHECKS, headers={"Authorization": f"Bearer {KEY}"})

        check()
