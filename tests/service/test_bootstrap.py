"""What a new installation starts from: a key that nobody guesses, in a folder that nobody else reads."""

import secrets
import stat

import pytest

from service import __main__ as serve
from service.launch.folder import Exit, Refusal, close_to_others
from service.launch.key import bootstrap_key, refuse_weak_key

FINE = "9xYc0vTq3LrWm7KfZbNd2HsGaJePuQi5o1"


@pytest.mark.parametrize(
    ("key", "fault"),
    [
        ("hunter", "has 6 characters; it needs 32 random ones"),
        ("stilb_" + "0123456789abcdefghijklmnopqrst", "has 30 characters"),
        ("stilb_" + "0" * 40, "repeats itself"),
        ("01" * 20, "repeats itself"),
        ("abcdefgh" * 5, "repeats itself"),
        ("abcde" + "edcba" * 6, "repeats itself"),
        ("a b" + FINE, "no request can send"),
        ("ä" + FINE, "no request can send"),
    ],
)
def test_a_key_that_could_be_guessed_is_refused_in_a_line_that_helps(tmp_path, key, fault):
    with pytest.raises(Refusal, match=fault) as refused:
        bootstrap_key(tmp_path, key)
    assert "STILB_KEY" in str(refused.value)
    assert "token_urlsafe(32)" in str(refused.value)
    assert key not in str(refused.value)
    if key.isascii():
        (tmp_path / "key").write_text(key)
        with pytest.raises(Refusal, match=fault):
            bootstrap_key(tmp_path, "")


def test_what_chance_makes_is_taken():
    for _ in range(200):
        for key in (secrets.token_urlsafe(32), secrets.token_hex(16), str(secrets.randbits(106) + 10**31)):
            refuse_weak_key(key, "STILB_KEY")


def test_the_service_itself_refuses_a_weak_key(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("store.logs.configure_logging", lambda _: None)
    monkeypatch.setenv("STILB_DATA", str(tmp_path / "data"))
    monkeypatch.setenv("STILB_KEY", "secret")
    assert serve.main() == Exit.CANNOT_START
    said = capsys.readouterr().err
    assert said.startswith("stilb: the key in STILB_KEY has 6 characters")
    assert said.count("\n") == 1


def mode_of(path):
    return stat.S_IMODE(path.stat().st_mode)


def test_a_key_is_made_once_for_its_owner_alone_unless_one_is_given(tmp_path):
    made = bootstrap_key(tmp_path, "")
    assert (bootstrap_key(tmp_path, FINE), bootstrap_key(tmp_path, "")) == (FINE, made)
    assert mode_of(tmp_path / "key") == 0o600


@pytest.fixture
def said():
    return []


def test_the_data_folder_is_made_for_nobody_else(tmp_path, said):
    close_to_others(tmp_path / "new" / "data", said.append)
    assert (mode_of(tmp_path / "new" / "data"), said) == (0o700, [])


@pytest.mark.parametrize("earlier", ["stilb.sqlite", "session-secret", None])
def test_an_existing_one_is_closed_and_that_is_said(tmp_path, said, earlier):
    tmp_path.chmod(0o755)
    if earlier:
        (tmp_path / earlier).touch()
    close_to_others(tmp_path, said.append)
    assert mode_of(tmp_path) == 0o700
    assert said == [f"the data folder {tmp_path} was open to other users (mode 755); it is now 700"]
    close_to_others(tmp_path, said.append)
    assert len(said) == 1


@pytest.mark.parametrize("mode", [0o755, 0o1777])
def test_a_folder_of_other_things_stays_as_it_is(tmp_path, said, mode):
    (tmp_path / "thesis.tex").touch()
    if mode == 0o1777:
        (tmp_path / "lock").touch()
    tmp_path.chmod(mode)
    close_to_others(tmp_path, said.append)
    assert mode_of(tmp_path) == mode
    assert "name a folder of its own" in said[0]
