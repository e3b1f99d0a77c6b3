"""What schemathesis makes of the published document: every route answers as it says, whatever is sent."""

import re

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from service.uploads.tus import PIECE
from tests.support.everything import make_one_of_each
from tests.support.house import KEY

EXAMPLES = 2
# Where a request that the document allows may be refused as of a wrong form: no schema says that two fields
# go together (body, query), what time it is, what the database and the operator hold, or which query goes
# with which body.
UNSAID = {
    **dict.fromkeys(
        ("/v1/campaigns", "/v1/campaigns/{campaign_id}", "/v1/organisation"), r"body\.time_zone"
    ),  # a name of the IANA database
    "/v1/campaigns/{campaign_id}/calibrations": r"body\..*",  # of another method than the campaign's
    "/v1/campaigns/{campaign_id}/checklist": r"body\.items\.\d+\.key",
    "/v1/campaigns/{campaign_id}/frames": r"body\.frame_ids",
    "/v1/campaigns/{campaign_id}/motion": r"query\.pixel_pitch_um",
    "/v1/keys": r"body\.expires_at",
    "/v1/meters": r"body\.certificate",  # due before it was issued
    "/v1/tools/exposure": r"query\..*",
    "/v1/uploads": r"header\.Upload-Length",  # which a body that is the whole file does without
    "/v1/uploads/{upload_id}": r"header\.Upload-Offset",  # which a piece needs, and nothing else
}


def list_unsaid(case, response):
    """Yield the fields for which a request that the document allows is refused without its saying so.

    Other codes than that of a wrong form name a rule of their own.
    """
    if case.meta.generation.mode.is_positive and response.status_code == 422:
        problem = response.json()
        known = re.compile(rf"body|query|query\.cursor|{UNSAID.get(case.operation.path, 'body')}")
        for each in problem.get("errors", ()) if problem["code"] == "validation_failed" else ():
            if not known.fullmatch(each["field"]):
                yield case.operation.label, each["field"], each["message"]


@pytest.fixture
def known(staged):
    """Ids that exist, so that not every request ends in 404."""
    return staged(make_one_of_each)


# the stricter one: it refuses what SQLite stores, a NUL in a text and a number too large for its column
@pytest.mark.parametrize("database_url", ["postgresql"], indirect=True)
def test_every_route_answers_as_the_document_says(house, known):
    # its import takes two seconds, which every process of a test run would spend on collecting
    import schemathesis  # noqa: PLC0415
    from schemathesis.specs.openapi import checks  # noqa: PLC0415

    schemathesis.serializer.alias([PIECE], "application/octet-stream")
    wanted = [
        schemathesis.checks.not_a_server_error,
        checks.status_code_conformance,
        checks.content_type_conformance,
        checks.response_headers_conformance,
        checks.response_schema_conformance,
        checks.negative_data_rejection,
    ]
    schema = schemathesis.openapi.from_asgi("/openapi.json", house.app)
    # the key goes with every request below; what happens without one is told in test_keys.py
    schema.config.generation.with_security_parameters = False
    # of an upload the version of its protocol is asked for first
    rejected = schema.config.checks.negative_data_rejection
    rejected.expected_statuses = [*rejected.expected_statuses, "412"]
    unsaid = set()
    for result in schema.get_all_operations():
        operation = result.ok()
        named = {p.name: known[p.name] for p in operation.path_parameters}
        if operation.path == "/v1/campaigns/{campaign_id}/events":
            named = {}  # a campaign's stream has no end
        strategies = [
            operation.as_strategy(mode, path_parameters=ids)
            for mode in schemathesis.generation.GenerationMode
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
            response = case.call_and_validate(checks=wanted, headers={"Authorization": f"Bearer {KEY}"})
            unsaid.update(list_unsaid(case, response))

        check()
    assert not unsaid
