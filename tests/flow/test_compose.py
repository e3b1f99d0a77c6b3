"""The compose file says what it should; the flow tests start the same commands with the same settings."""

import json
import re
from importlib import resources

import pytest
from jsonschema import Draft202012Validator

from service.command import COMMANDS
from service.launch.folder import Exit
from service.up import ROSTER
from store.settings import Settings
from tests.support.compose import OURS, ROOT, S3, TLS, command_of, compose, environment_of, load_script

OPERATOR = {"STILB_BLOBS_URL": "s3://bucket/raw", "DOMAIN": "calib.example"}
FILES = ["docker-compose.yml", S3, TLS]
PINNED = re.compile(r"[\w/]+:[\w.-]+@sha256:[0-9a-f]{64}$", re.MULTILINE)


@pytest.mark.parametrize("path", FILES)
def test_it_is_valid_by_the_compose_specification(path):
    schema = json.loads(
        (resources.files("check_jsonschema") / "builtin_schemas/vendor/compose-spec.json").read_text()
    )
    errors = Draft202012Validator(schema).iter_errors(compose(path))
    assert [f"{error.json_path}: {error.message}" for error in errors] == []
    assert compose(path)["services"].keys() - compose()["services"].keys() <= {"caddy"}


def test_it_runs_what_the_launcher_runs():
    launched = {part.name: list(part.command) for part in ROSTER.parts}
    launched["migrate"], *others = (list(command) for command in ROSTER.before)
    assert others == []
    python, module, _, *options = launched["worker"]
    launched["worker"] = [python, module, "celery", "-A", "worker.app", "worker", *options]
    assert {name: command_of(name) for name in OURS} == launched


@pytest.mark.parametrize("name", OURS)
def test_every_setting_exists_and_database_and_broker_are_not_embedded(name):
    environment = environment_of(name, OPERATOR, S3, TLS)
    ours = {key.removeprefix("STILB_").lower() for key in environment if key.startswith("STILB_")}
    assert {name.removesuffix("_file") for name in ours} <= {*Settings.model_fields, "pulse"}
    assert {"data", "database_url", "broker_url"} <= ours
    assert ("blobs_url" in ours) == (name != "migrate")


def test_one_service_builds_the_image_and_each_is_limited():
    services = compose()["services"] | compose(TLS)["services"]
    assert [name for name, service in compose()["services"].items() if "build" in service] == ["migrate"]
    for service in (compose()["services"] | {"caddy": services["caddy"]}).values():
        assert service["cap_drop"] == ["ALL"]
        assert service["security_opt"] == ["no-new-privileges:true"]
        assert {"mem_limit", "cpus", "pids_limit"} <= service.keys()
        assert service["image"] == "stilb:local" or PINNED.search(service["image"])
        assert {"max-size", "max-file"} <= service["logging"]["options"].keys()
        assert all("size=" in each for each in service.get("tmpfs", []))
        assert "healthcheck" in service or service["restart"] == "no"


def test_only_the_service_knows_the_key():
    assert [name for name in OURS if "stilb_key" in compose()["services"][name]["secrets"]] == ["service"]
    assert [name for name in OURS if "STILB_KEY_FILE" in environment_of(name, {})] == ["service"]


@pytest.mark.parametrize("path", FILES)
def test_every_secret_is_a_file_that_its_container_has(path):
    """Nothing secret in an environment, which `docker inspect` shows to everybody who may ask."""
    secrets = compose().get("secrets", {}) | compose(path).get("secrets", {})
    for name, service in compose(path)["services"].items():
        for key, value in (service.get("environment") or {}).items():
            if re.search("KEY|SECRET|PASSWORD", key):
                assert key.endswith("_FILE"), f"{name}: {key}"
                assert value.removeprefix("/run/secrets/") in service["secrets"]
        assert set(service.get("secrets", [])) <= secrets.keys()
    assert {each["file"] for each in secrets.values()} == {f"${{SECRETS:-./secrets}}/{n}" for n in secrets}


def test_with_a_proxy_no_service_has_a_port_so_that_there_may_be_several():
    assert "container_name" not in compose()["services"]["service"]
    assert compose(TLS)["services"]["service"]["ports"] == []
    caddy, caddyfile = compose(TLS)["services"]["caddy"], (ROOT / "docs/deploy/Caddyfile").read_text()
    assert set(re.findall(r"{\$(\w+)", caddyfile)) == caddy["environment"].keys()
    assert caddy["environment"]["UPSTREAM"] == f"service:{environment_of('service', {})['STILB_PORT']}"
    assert all((ROOT / each.partition(":")[0]).is_file() for each in caddy["volumes"][:1])


def test_every_dependency_and_volume_is_there_and_can_become_what_is_waited_for():
    services = compose()["services"]
    for service in services.values():
        for other, wanted in service.get("depends_on", {}).items():
            if wanted["condition"] == "service_healthy":
                assert "healthcheck" in services[other]
            else:
                assert services[other]["restart"] == "no"
    used = {each.partition(":")[0] for service in services.values() for each in service.get("volumes", [])}
    assert used == set(compose()["volumes"])


def test_ours_can_write_nowhere_but_to_their_data_and_run_as_nobody_special():
    for name in OURS:
        service = compose()["services"][name]
        assert service["read_only"] is True
        assert service["volumes"] == ["data:/data"]
        assert [each.partition(":")[0] for each in service["tmpfs"]] == ["/tmp"]
    assert re.search(r"^USER stilb$", (ROOT / "Dockerfile").read_text(), re.MULTILINE)


def test_the_image_is_built_from_the_wheel_and_sees_no_more_than_it_needs():
    dockerfile = (ROOT / "Dockerfile").read_text()
    assert "python .ci/server_wheel.py /dist" in dockerfile
    assert "COPY --from=environment /dist/*.cdx.json " in dockerfile
    assert PINNED.search(re.search("^ARG PYTHON=(.+)$", dockerfile, re.MULTILINE)[1])
    assert dockerfile.count("FROM ${PYTHON}") == len(re.findall("^FROM", dockerfile, re.MULTILINE)) == 2
    allowed = {line[1:] for line in (ROOT / ".dockerignore").read_text().splitlines() if line[0] == "!"}
    others = {"requirements.lock", "requirements-bootstrap.lock", "pyproject.toml", "LICENSE", "README.md"}
    assert allowed == {*load_script("server_wheel").ROOMS, *others, ".ci", "docs/*.md", "docs/pictures"}
    assert all(list(ROOT.glob(each)) for each in allowed)


def test_the_unit_may_do_little_stops_as_late_as_the_launcher_and_names_its_exit_codes():
    unit = (ROOT / "docs/deploy/stilb.service").read_text()
    stated = dict(re.findall(r"^(\w+)=(.*)$", unit, re.MULTILINE))
    locked = ("DynamicUser", "NoNewPrivileges", "PrivateDevices", "PrivateTmp", "ProtectHome")
    wanted = dict.fromkeys((*locked, "RestrictNamespaces"), "yes")
    wanted |= {"CapabilityBoundingSet": "", "ProtectSystem": "strict", "UMask": "0077"}
    assert wanted.items() <= stated.items()
    assert {"MemoryMax", "TasksMax", "StateDirectory"} <= stated.keys()
    stop_s = int(re.search(r"^TimeoutStopSec=(\d+)$", unit, re.MULTILINE)[1])
    assert stop_s > 2 * Settings.model_fields["stop_grace_s"].default
    never = re.search(r"^RestartPreventExitStatus=(.+)$", unit, re.MULTILINE)[1].split()
    assert [Exit(int(code)).name for code in never] == ["CANNOT_START", "NEWER_SCHEMA", "ALREADY_RUNS"]
    for words in re.findall(r"/bin/stilb-server (.+)$", unit, re.MULTILINE):
        command, *parts = words.split()
        assert command in COMMANDS
        assert set(parts) <= {part.name for part in ROSTER.parts}


@pytest.mark.parametrize("name", ["service", "worker"])
def test_who_finishes_what_is_open_gets_its_grace_and_the_time_to_end(name):
    granted = compose()["services"][name]["stop_grace_period"]
    assert int(granted.removesuffix("s")) > Settings.model_fields["stop_grace_s"].default
