"""`python -m tests.store.record_release`: what the code of a release writes, for the test of later upgrades.

A campaign of 15 frames, two published versions and a measurement: the rows of every table, and answers.
"""

import json
import lzma
import sys
import tempfile
from pathlib import Path

from sqlalchemy import MetaData

from store.database import Database
from store.migrate import migrate
from store.software import list_revisions, read_version
from tests.store.test_upgrades import RELEASES
from tests.support.campaigns import calibrate, published_campaign
from tests.support.house import House
from tests.support.measuring import measure


def record(folder: Path) -> dict[str, object]:
    database = Database(f"sqlite:///{folder / 'release.sqlite'}")
    migrate(database)
    with House(database, folder) as house:
        first = published_campaign(house, isos=(3200,))
        campaign = {"id": first["campaign_id"]}
        second = calibrate(house, campaign, model="affine")
        publication = {"valid_from": "2026-06-01T00:00:00Z", "reason": "another model"}
        house.post(f"/v1/calibrations/{second['id']}/publish", publication, status=200)
        frame_id = first["points"][0]["frame_id"]
        measurement = measure(house, {"id": frame_id}, first)
        coefficients = f"/v1/cameras/{first['camera_id']}/coefficients?method=luminance&at="
        paths = (
            *(f"{coefficients}{at}T00:00:00Z" for at in ("2026-05-15", "2026-07-01")),
            *(f"/v1/calibrations/{each['id']}" for each in (first, second)),
            f"/v1/measurements/{measurement['id']}",
            f"/v1/campaigns/{campaign['id']}",
            f"/v1/frames/{frame_id}",
        )
        answers = {path: house.get(path) for path in paths}
    metadata = MetaData()
    tables = {}
    with database.engine.connect() as connection:
        metadata.reflect(connection)
        for table in metadata.sorted_tables:
            rows = [
                [_plain(cell) for cell in row]
                for row in connection.exec_driver_sql(f'SELECT * FROM "{table.name}"')
            ]
            if rows and table.name != "alembic_version":
                tables[table.name] = {"columns": [column.name for column in table.columns], "rows": rows}
    database.dispose()
    return {"release": read_version(), "schema": list_revisions()[-1], "tables": tables, "answers": answers}


def _plain(cell: object) -> object:
    return cell.hex() if isinstance(cell, bytes) else cell


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        text = json.dumps(record(Path(folder)))
    path = RELEASES / f"{read_version()}.json.xz"
    path.write_bytes(lzma.compress(text.encode()))
    sys.stdout.write(f"{path}\n")
