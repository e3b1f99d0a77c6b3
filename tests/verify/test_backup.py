"""A backup is proven before it is needed: a cut database, missing and flipped files are all found."""

import shutil
import sqlite3
from contextlib import closing

import pytest

from store.blobs.objects import ObjectBlobs
from tests.support.blobs import files, put, spoil, zero
from tests.support.campaigns import published_campaign
from tests.support.printed import link_checkout, read_blocks, type_in
from verify.backup import main


def address_of(house):
    return house.database.url.render_as_string(hide_password=False)


def test_a_whole_backup_is_told_from_one_that_lacks_files(house, tmp_path, capsys):
    """Of PostgreSQL the files alone: its address names the database."""
    campaign = house.campaign()
    frames = [house.upload(campaign, house.frame_bytes(seed=seed), role="dark") for seed in (1, 2, 3)]
    house.work()
    folder = tmp_path / "backup"
    shutil.copytree(house.folder / "blobs", folder / "blobs")
    options = [] if house.database.is_sqlite else ["--database", address_of(house)]
    if house.database.is_sqlite:
        path = house.database.url.database
        with (
            closing(sqlite3.connect(path)) as source,
            closing(sqlite3.connect(folder / "stilb.sqlite")) as copy,
        ):
            source.backup(copy)
    before = files(folder)
    assert main([str(folder), *options]) == 0
    first, second, *_ = capsys.readouterr().out.splitlines()
    assert (first.startswith("proven: 6 files, "), second) == (True, "this backup is whole")
    assert files(folder) == before, "nothing is written into a backup"
    spoil(house.blobs, folder / "blobs", frames[0]["sha256"], None)
    zero(folder / "blobs", frames[2]["sha256"], first=4000, count=9)
    assert main([str(folder), *options]) == 1
    told = capsys.readouterr()
    assert set(told.err.splitlines()) == {
        f"stilb: the file {frames[0]['sha256']} is missing",
        f"stilb: the file {frames[2]['sha256']} is damaged",
    }
    assert told.out.splitlines()[-1] == "this backup is NOT whole"


@pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
def test_the_printed_commands_make_a_backup_and_verify_it(house, tmp_path_factory):
    house.upload(house.campaign(), house.frame_bytes(), role="dark")
    (house.folder / "signing-key").write_text("secret")
    folder = tmp_path_factory.mktemp("checkout")
    link_checkout(folder)
    (folder / "stilb-data").symlink_to(house.folder)
    told = type_in(folder, "".join(each for each in read_blocks("docs/operations.md") if "backup" in each))
    assert told.splitlines()[-1] == "this backup is whole"
    assert {path.name for path in (folder / "backup").iterdir()} >= {"signing-key", "blobs"}


@pytest.mark.either_database
def test_a_lost_certificate_is_named(house, staged, capsys):
    version = staged(published_campaign, isos=(3200,))
    (issued,) = house.get(f"/v1/calibrations/{version['id']}")["certificates"]
    zero(house.folder, issued["pdf_sha256"], first=4000, count=9)
    assert main([str(house.folder), "--database", address_of(house)]) == 1
    said = f"stilb: the file {issued['pdf_sha256']} of certificate {issued['number']} is damaged"
    assert capsys.readouterr().err.splitlines() == [said]


@pytest.fixture
def copied(migrated_sqlite, tmp_path):
    folder = tmp_path / "copied"
    (folder / "blobs").mkdir(parents=True)
    shutil.copyfile(migrated_sqlite, folder / "stilb.sqlite")
    assert main([str(folder)]) == 0
    return folder


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda data: data[: len(data) // 2], "the database"),
        (lambda data: data[:-4096], "the database"),
        (lambda _data: b"", "it is empty, or none of stilb's"),
        (lambda data: data[:100] + bytes(8000) + data[8100:], "the database"),
        (lambda _data: b"no database" * 1000, "file is not a database"),
    ],
)
def test_a_cut_or_damaged_database_is_found(copied, change, said, capsys):
    path = copied / "stilb.sqlite"
    path.write_bytes(change(path.read_bytes()))
    assert main([str(copied)]) == 1
    assert said in capsys.readouterr().err


def test_what_is_no_backup_is_said(tmp_path, capsys):
    assert main([str(tmp_path)]) == 1
    assert main([str(tmp_path / "absent")]) == 1
    told = capsys.readouterr().err
    assert "there is no" in told
    assert "DATABASE=" in told


@pytest.mark.usefixtures("s3_bucket")
def test_the_files_may_be_in_a_bucket(copied, capsys):
    stored = put(ObjectBlobs("s3://raw/copy", copied / "cache"), b"a map")
    row = (stored.sha256, 5, "2026-05-01 00:00:00")
    with closing(sqlite3.connect(copied / "stilb.sqlite")) as database, database:
        database.execute("INSERT INTO blob (sha256, size_bytes, created_at) VALUES (?, ?, ?)", row)
    assert main([str(copied), "--blobs", "s3://raw/copy"]) == 0
    assert main([str(copied)]) == 1
    assert f"the file {stored.sha256} is missing" in capsys.readouterr().err
