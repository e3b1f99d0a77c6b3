"""Signing in: the key is checked, kept for its owner alone, and goes to no other service."""

import json
import stat

import pytest

import stilb
from stilb.commands.output import Exit


def test_a_key_is_checked_and_kept_for_its_owner_alone(stilb_command, team, config):
    """Also in the place of a file that others could read."""
    ended = stilb_command("login", f"{team.url}/", "--key", team.key)
    assert (ended.code, ended.err) == (Exit.DONE, "")
    assert "may read, upload, calibrate, publish, admin" in ended.out
    assert stat.S_IMODE(config.stat().st_mode) == 0o700
    kept = config / "login.json"
    told = kept.read_text()
    assert json.loads(told) == {"url": team.url, "key": team.key}
    kept.write_text("{}")
    kept.chmod(0o644)
    assert stilb_command("login", team.url, "--key", team.key).code == Exit.DONE
    assert (kept.read_text(), stat.S_IMODE(kept.stat().st_mode)) == (told, 0o600)


def test_a_wrong_key_is_not_kept(stilb_command, team, config):
    ended = stilb_command("login", team.url, "--key", "stilb_wrong")
    assert ended.code == Exit.KEY
    assert "unauthenticated" in ended.err
    assert "stilb login URL" in ended.err
    assert not (config / "login.json").exists()


def test_a_key_of_any_scope_and_name_can_sign_in(stilb_command, team):
    with team.http() as http:
        asked = {"name": "[red]card[/red]", "scopes": ["upload"]}
        weak = http.post("/v1/keys", json=asked).json()["secret"]
    said = stilb_command("login", team.url, "--key", weak).out
    assert ("may upload" in said, "'[red]card[/red]'" in said) == (True, True)
    ended = stilb_command("jobs", "--json")
    assert (ended.code, ended.json["error"]["code"]) == (Exit.KEY, "scope_missing")
    assert "Ask an admin" in ended.err


def test_the_key_may_be_typed(stilb_command, team, monkeypatch):
    monkeypatch.setattr(
        "typer.prompt", lambda *_, hide_input, err: f" {team.key} " if hide_input and err else ""
    )
    ended = stilb_command("login", team.url, "--json")
    assert ended.json["scopes"] == ["read", "upload", "calibrate", "publish", "admin"]


def test_whoami_and_logout(signed_in, team, config):
    told = signed_in("whoami", "--json").json
    assert (told["url"], told["name"]) == (team.url, "first")
    assert signed_in("logout").out == "Signed out.\n"
    assert not (config / "login.json").exists()
    ended = signed_in("whoami")
    assert (ended.code, ended.out) == (Exit.KEY, "")
    assert "Sign in first: stilb login URL" in ended.err
    # what `make export` passes on without URL=
    assert "Sign in first: stilb login URL" in signed_in("whoami", "--url", "").err
    assert signed_in("logout", "--json").json == {"signed_out": False}


def test_keys_are_made_listed_and_revoked(signed_in, team):
    made = signed_in("key", "create", "tablet", "--scope", "read", "--expires", "2090-01-01")
    assert made.out.startswith("stilb_")
    assert "not shown again" in made.err
    assert "expires 2090-01-01" in signed_in("key", "list").out
    said = signed_in("key", "change", "tablet", "--person", "A. Meier", "--role", "physicist")
    assert "is used by A. Meier, physicist" in said.out
    assert "A. Meier" in signed_in("key", "list").out
    assert signed_in("key", "revoke", "nobody").code == Exit.NOT_FOUND
    with stilb.Client(team.url, made.out.strip(), retries=0) as tablet:
        assert tablet.own_key().name == "tablet"
    assert "is revoked" in signed_in("key", "revoke", "tablet").out
    listed = signed_in("key", "list", "--all", "--json").json["items"]
    assert [each["name"] for each in listed if "revoked_at" in each] == ["tablet"]


def test_the_audit_trail_is_checked_and_saved(signed_in, team, tmp_path):
    signed_in("key", "create", "tablet", "--scope", "read")
    told = signed_in("audit", "--save", str(tmp_path / "trail.csv"), "--to", "2090-01-01")
    assert (told.code, told.out.startswith("the chain is intact: ")) == (Exit.DONE, True)
    assert (tmp_path / "trail.csv").read_text().startswith("seq,at,actor,")
    with stilb.Client(team.url, team.key, retries=0) as client:
        client.save_audit(tmp_path / "trail.jsonl")
        newest = next(client.audit())
        assert client.check_audit().head == f"{newest.seq}:{newest.raw['sha256']}"
    assert json.loads((tmp_path / "trail.jsonl").read_text().splitlines()[-1]) == newest.raw


def test_the_kept_key_goes_to_no_other_service(signed_in, service):
    ended = signed_in("whoami", "--url", service.url)
    assert ended.code == Exit.KEY
    assert f"stilb login {service.url}" in ended.err
    assert service.asked == []


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("login", "stilb.example.org", "--key", "k"), Exit.USAGE, "must begin with http"),
        (("login", "ftp://stilb.example.org", "--key", "k"), Exit.USAGE, "must begin with http"),
        (("login", "http://127.0.0.1:9", "--key", "k"), Exit.NETWORK, "stilb doctor"),
        (("push", "--json", "--no-such-option"), Exit.USAGE, "--no-such-option"),
    ],
)
def test_what_is_mistyped_or_not_there_is_told_on_stderr(stilb_command, words, code, said):
    ended = stilb_command(*words)
    assert (ended.code, ended.out) == (code, "")
    assert said in ended.err


def test_something_else_that_answers(stilb_command, service):
    service.will_answer(b"<h1>It works!</h1>", headers={"Content-Type": "text/html"})
    ended = stilb_command("login", service.url, "--key", "k", "--json")
    assert (ended.code, ended.json["error"]["exit_code"]) == (Exit.NETWORK, Exit.NETWORK)
    assert "is this a stilb service?" in ended.err


def test_a_kept_file_that_is_broken(signed_in, config):
    (config / "login.json").write_text("[]")
    ended = signed_in("whoami")
    assert ended.code == Exit.USAGE
    assert "Sign in again" in ended.err


def test_ctrl_c(stilb_command, monkeypatch):
    def stop(_):
        raise KeyboardInterrupt

    monkeypatch.setattr("stilb.commands.output.read_login", stop)
    ended = stilb_command("whoami")
    assert (ended.code, "run the same command again to continue" in ended.err) == (Exit.INTERRUPTED, True)
