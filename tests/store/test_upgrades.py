"""Databases of every release come up to this version, and answer what they answered.

`releases/` holds the rows that the code of each release wrote for a campaign of 15 frames, two published
versions and a measurement, and its answers about them; the frozen migrations make its schema.
"""

import json
import lzma
import re
from pathlib import Path

import pytest
from packaging.version import Version
from sqlalchemy import Boolean, LargeBinary, MetaData, text

from service.documents.issuing import Backlog
from store.blobs import blobs_from_url
from store.codec import drop_absent
from store.migrate import migrate
from tests.support.house import House
from verify.audit import check_rows
from verify.audit import main as check_audit

RELEASES = Path(__file__).parent / "releases"
# the oldest goes the whole way on both; the migrations of later ones are among its own
ON = {"0.2.0": ["sqlite"], "0.3.0": ["postgresql"]}
CHANGES = re.findall(r"^## (\d+\.\d+\.\d+) ", Path("CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)


# what is judged when it is asked for, by the code of now
JUDGED = {".flags", ".to_do_better", ".missing", ".advice", ".findings", ".findings.action"}


def fill(database, tables):
    """Write rows as they were; circles of references are whole only at the end."""
    metadata = MetaData()
    with database.engine.begin() as connection:
        metadata.reflect(connection, only=list(tables))
        defer = ("SET session_replication_role = replica", "PRAGMA defer_foreign_keys = ON")
        connection.execute(text(defer[database.is_sqlite]))
        for name, table in tables.items():
            kinds = [metadata.tables[name].columns[each].type for each in table["columns"]]
            columns = ", ".join(f'"{each}"' for each in table["columns"])
            values = ", ".join(f":{each}" for each in table["columns"])
            rows = [dict(zip(table["columns"], map(read, kinds, row), strict=True)) for row in table["rows"]]
            # some are made with the table
            connection.execute(text(f'DELETE FROM "{name}"'))
            connection.execute(text(f'INSERT INTO "{name}" ({columns}) VALUES ({values})'), rows)
        if not database.is_sqlite:
            connection.execute(text("SET session_replication_role = origin"))


def read(kind, cell):
    if cell is not None and isinstance(kind, Boolean):
        return bool(cell)
    return bytes.fromhex(cell) if cell is not None and isinstance(kind, LargeBinary) else cell


def differences(before, now, place=""):
    """Where two answers differ in what both have."""
    if isinstance(before, dict) and isinstance(now, dict):
        for name in before.keys() & now.keys():
            yield from differences(before[name], now[name], f"{place}.{name}")
    elif isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        for old, new in zip(before, now, strict=True):
            yield from differences(old, new, place)
    elif before != now:
        yield place, before, now


def test_every_release_is_here():
    assert {path.name.removesuffix(".json.xz") for path in RELEASES.iterdir()} == set(CHANGES)


@pytest.mark.parametrize(
    ("release", "empty"),
    [(release, kind) for release in CHANGES for kind in ON.get(release, ["sqlite", "postgresql"])],
    indirect=["empty"],
)
def test_rows_of_a_release_are_answered_as_it_answered_them(release, empty, tmp_path, request, monkeypatch):
    recorded = json.loads(lzma.decompress((RELEASES / f"{release}.json.xz").read_bytes()))
    migrate(empty, recorded["schema"])
    fill(empty, recorded["tables"])
    migrate(empty)
    with House(empty, tmp_path) as house:
        for path, before in recorded["answers"].items():
            now = house.get(path)
            assert before.keys() <= now.keys()
            found = [each for each in differences(before, now) if each[0] not in JUDGED]
            assert found == [], path
    monkeypatch.setenv("STILB_DATABASE_URL", empty.url.render_as_string(hide_password=False))
    assert check_audit([]) == 0
    # from 0.3.0 on publishing issues them
    if Version(release) < Version("0.3.0"):
        check_certificates(recorded, empty, tmp_path, request, monkeypatch)


def check_certificates(recorded, empty, tmp_path, request, monkeypatch):
    """They are issued once: on SQLite with files on the disk, on PostgreSQL with files in S3."""
    (tmp_path / "blobs").mkdir(exist_ok=True)
    place = str(tmp_path / "blobs")
    if not empty.is_sqlite:
        place = f"s3://{request.getfixturevalue('s3_bucket')}"
    published = [path for path in recorded["answers"] if path.startswith("/v1/calibrations/")]

    def start():
        house = House(empty, tmp_path)
        house.blobs = blobs_from_url(place, tmp_path)
        return house

    def read(house):
        files = [f"{path}/certificate.{form}" for path in published for form in ("json", "pdf")]
        return {
            file: (found := house.http.get(file)).content + found.headers["ETag"].encode() for file in files
        }

    with start() as house:
        # the service that issues them is killed after the first
        assert Backlog(house.app.state.context).issue_next() == 1.0
    with start() as house:
        backlog = Backlog(house.app.state.context)
        assert [backlog.issue_next() for _ in published] == [1.0] * (len(published) - 1) + [3600.0]
        issued = read(house)
        assert all(b"%PDF-" in content for file, content in issued.items() if file.endswith(".pdf"))
        certificate = house.get(f"{published[0]}/certificate.json")
        assert certificate["issued"]["at_upgrade"] is True
        assert certificate["result"] == recorded_result(recorded, published[0])
    monkeypatch.setattr("store.software.FIT_CODE_VERSION", "9.9.9")
    monkeypatch.setattr("service.documents.certificate._RELATES", "Another sentence.")
    monkeypatch.setattr("store.software.RENDERER", "render-99")
    with start() as house:
        assert Backlog(house.app.state.context).issue_next() == 3600.0
        assert read(house) == issued
    assert check_rows(empty).faults == []


def recorded_result(recorded, path):
    table = recorded["tables"]["calibration"]
    rows = [dict(zip(table["columns"], row, strict=True)) for row in table["rows"]]
    (row,) = [each for each in rows if path.endswith(each["id"])]
    return drop_absent(json.loads(row["result"]))
