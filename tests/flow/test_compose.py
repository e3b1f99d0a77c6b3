"""The compose file says what it should; the flow tests start the same commands with the same settings."""

import json
import re
import sys
from importlib import resources

import pytest
from jsonschema import Draft202012Validator

from service.up import ROSTER
from store.settings import Settings
from tests.support.compose import OURS, ROOT, command_of, compose, environment_of

GIVEN = {
    "STILB_KEY": "stilb_key_of_32_characters_and_some_more",
    "POSTGRES_PASSWORD": "secret",
    "AWS_ACCESS_KEY_ID": "id",
    "AWS_SECRET_ACCESS_KEY": "secret",
}


def test_it_is_valid_by_the_compose_specification():
    schema = json.loads(
        (resources.files("check_jsonschema") / "builtin_schemas/vendor/compose-spec.json").read_text()
    )
    errors = Draft202012Validator(schema).iter_errors(compose())
    assert [f"{error.json_path}: {error.message}" for error in errors] == []


def test_it_runs_what_the_launcher_runs():
    launched = {part.name: list(part.command) for part in ROSTER.parts}
    launched["migrate"], *others = (list(command) for command in ROSTER.before)
    assert others == []
    assert {name: command_of(name) for name in OURS} == launched
    assert all(command[:2] == [sys.executable, "-m"] for command in launched.values())


@pytest.mark.parametrize("name", OURS)
def test_every_setting_exists_and_none_stays_embedded(name):
    environment = environment_of(name, GIVEN)
    ours = {key.removeprefix("STILB_").lower() for key in environment if key.startswith("STILB_")}
    assert ours <= set(Settings.model_fields)
    assert {"data", "database_url", "broker_url", "blobs_url"} <= ours


def test_one_service_builds_the_image_and_each_is_limited():
    services = compose()["services"]
    assert [name for name, service in services.items() if "build" in service] == ["migrate"]
    for service in services.values():
        assert service["cap_drop"] == ["ALL"]
        assert {"mem_limit", "pids_limit"} <= service.keys()
        assert {"max-size", "max-file"} <= service["logging"]["options"].keys()
        assert all("size=" in each for each in service.get("tmpfs", []))


def test_only_the_service_knows_the_key():
    assert [name for name in OURS if "STILB_KEY" in environment_of(name, GIVEN)] == ["service"]


@pytest.mark.parametrize("missing", GIVEN)
def test_no_secret_has_a_default(missing):
    given = {name: value for name, value in GIVEN.items() if name != missing}
    with pytest.raises(KeyError, match=missing):
        [environment_of(name, given) for name in compose()["services"]]


def test_no_secret_stands_in_the_file():
    for name, service in compose()["services"].items():
        for key, value in service.get("environment", {}).items():
            if re.search("KEY|SECRET|PASSWORD", key):
                assert re.fullmatch(r"\$\{\w+:\?[^}]+\}", value), f"{name}: {key}"


def test_every_dependency_is_there_and_can_become_what_is_waited_for():
    services = compose()["services"]
    for service in services.values():
        for other, wanted in service.get("depends_on", {}).items():
            if wanted["condition"] == "service_healthy":
                assert "healthcheck" in services[other]
            else:
                assert services[other]["restart"] == "no"


def test_every_named_volume_is_declared_and_used():
    services = compose()["services"].values()
    used = {volume.partition(":")[0] for service in services for volume in service.get("volumes", [])}
    assert used == set(compose()["volumes"])


def test_ours_can_write_nowhere_but_to_their_data_and_run_as_nobody_special():
    for name in OURS:
        service = compose()["services"][name]
        assert service["read_only"] is True
        assert service["cap_drop"] == ["ALL"]
        assert service["volumes"] == ["data:/data"]
        assert [each.partition(":")[0] for each in service["tmpfs"]] == ["/tmp"]
    assert re.search(r"^USER stilb$", (ROOT / "Dockerfile").read_text(), re.MULTILINE)


def test_the_image_holds_the_rooms_that_run_and_no_others():
    dockerfile = (ROOT / "Dockerfile").read_text()
    copied = set(re.findall(r"^COPY (\w+) \1$", dockerfile, re.MULTILINE))
    assert copied == {"migrations", "radiometry", "store", "worker", "service", "docs"}
    allowed = set((ROOT / ".dockerignore").read_text().splitlines())
    assert {f"!{room}" for room in copied} <= allowed
    assert all((ROOT / room).is_dir() for room in copied)
    assert "\nCOPY pyproject.toml ./\n" in dockerfile
    assert "!pyproject.toml" in allowed


@pytest.mark.parametrize("name", ["service", "worker"])
def test_who_finishes_what_is_open_gets_its_grace_and_the_time_to_end(name):
    granted = compose()["services"][name]["stop_grace_period"]
    assert int(granted.removesuffix("s")) > Settings.model_fields["stop_grace_s"].default
