"""What schemathesis makes of the published document: every route answers as it says, whatever is sent."""

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from service.upload_headers import PIECES
from tests.support.everything import make_one_of_each
from tests.support.house import KEY

EXAMPLES = 4


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

    schemathesis.serializer.alias(list(PIECES), "application/octet-stream")
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
            case.call_and_validate(checks=wanted, headers={"Authorization": f"Bearer {KEY}"})

        check()
