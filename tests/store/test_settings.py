import pytest
from sqlalchemy import make_url

from store.settings import Settings, read_settings

pytestmark = pytest.mark.unit


@pytest.fixture
def refused(monkeypatch, capsys):
    """Return what a process says that does not start with these settings."""

    def start(**environment: str) -> str:
        for name, value in environment.items():
            monkeypatch.setenv(name, value)
        with pytest.raises(SystemExit, check=lambda end: end.code == 2):
            read_settings()
        return capsys.readouterr().err

    return start


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("STILB_DATABSE_URL", "there is no such setting; did you mean STILB_DATABASE_URL?"),
        ("STILB_KEYFILE", "there is no such setting; did you mean STILB_KEY_FILE?"),
        ("STILB_ZZZ", "there is no such setting; docs/settings.md lists them."),
        ("stilb_prot", "there is no such setting; did you mean STILB_PORT?"),
        ("stilb_port", "write STILB_PORT: its name is in capitals"),
    ],
)
def test_a_name_that_is_no_setting_is_refused_with_the_nearest_one(refused, name, line):
    assert refused(**{name: "1"}) == f"stilb: {name}: {line}\n"


def test_a_value_out_of_range_is_named(refused):
    told = refused(STILB_WORKER_THREADS="0", STILB_PORT="x", STILB_LEASE_S="inf", STILB_STOP_GRACE_S="1e9")
    assert "STILB_WORKER_THREADS: Input should be greater than or equal to 1" in told
    assert "STILB_PORT: Input should be a valid integer" in told
    assert "STILB_LEASE_S: Input should be less than or equal to 86400" in told
    assert "STILB_STOP_GRACE_S: Input should be less than or equal to 86400" in told


@pytest.mark.parametrize(
    ("name", "value", "line"),
    [
        ("DATABASE_URL", "postgres://a@b/c", "must begin with postgresql+psycopg:// or sqlite:///"),
        ("DATABASE_URL", "/data/stilb.sqlite", "must begin with postgresql+psycopg:// or sqlite:///"),
        (
            "BROKER_URL",
            "localhost:6379",
            "must begin with redis://, rediss://, redis+socket:// or sentinel://",
        ),
        ("BLOBS_URL", "s3://bucket?x", "must be a folder, file:///folder or s3://bucket/prefix"),
        ("BLOBS_URL", "gs://bucket", "must be a folder, file:///folder or s3://bucket/prefix"),
        *[
            ("CORS_ORIGINS", each, "must be origins such as https://board.example, separated by commas")
            for each in ("board.example", "https://a.example https://b.example", "https://board.example/app")
        ],
        *[
            ("ALLOWED_HOSTS", each, "must be host names such as https://calib.example, separated by commas")
            for each in ("*", "https://calib.example/app")
        ],
    ],
)
def test_an_address_of_another_kind_is_refused_without_what_it_holds(refused, name, value, line):
    assert refused(**{f"STILB_{name}": value}) == f"stilb: STILB_{name}: {line}\n"


def test_a_process_may_wait_for_the_database_and_not_count_as_hung():
    assert Settings(database_timeout_s=60.0).hang_s > 60.0


def test_a_secret_is_read_from_the_file_that_is_named(monkeypatch, tmp_path):
    secret = tmp_path / "key"
    secret.write_text("abc\n", encoding="utf-8")
    monkeypatch.setenv("STILB_KEY_FILE", str(secret))
    monkeypatch.setenv("STILB_URL", "of the command line")
    assert read_settings().key.get_secret_value() == "abc"


def test_a_secret_that_is_given_twice_or_cannot_be_read_is_refused(refused, tmp_path, monkeypatch):
    assert "No such file" in refused(STILB_KEY_FILE=str(tmp_path / "none"))
    (tmp_path / "empty").write_text(" \n", encoding="utf-8")
    assert "empty: the file is empty" in refused(STILB_KEY_FILE=str(tmp_path / "empty"))
    monkeypatch.delenv("STILB_KEY_FILE")
    assert "AWS_SESSION_TOKEN_FILE: " in refused(AWS_SESSION_TOKEN_FILE=str(tmp_path / "empty"))
    monkeypatch.delenv("AWS_SESSION_TOKEN_FILE")
    (tmp_path / "binary").write_bytes(b"\xff")
    assert "binary: 'utf-8' codec" in refused(STILB_KEY_FILE=str(tmp_path / "binary"))
    assert refused(STILB_KEY="a") == "stilb: STILB_KEY: also given as STILB_KEY_FILE; remove one of them\n"


def test_an_empty_file_name_stands_for_none(monkeypatch):
    monkeypatch.setenv("STILB_KEY_FILE", "")
    assert read_settings() == Settings()


def test_the_database_password_is_put_into_the_address_whatever_it_holds(monkeypatch, refused):
    monkeypatch.setenv("STILB_DATABASE_PASSWORD", "a@b/c:d")
    assert "needs a STILB_DATABASE_URL with a user" in refused(STILB_DATABASE_URL="")
    monkeypatch.setenv("STILB_DATABASE_URL", "postgresql+psycopg://stilb@db:5432/stilb")
    assert make_url(read_settings().effective_database_url).password == "a@b/c:d"
