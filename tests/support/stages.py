"""Houses as a recipe left them: the recipe runs once, every later test gets a copy of what it made."""

import copy
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from inspect import signature
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import func, select

from store.tables import AuditEntry
from tests.support.house import House
from tests.support.postgres import PostgresServer


@dataclass(frozen=True, kw_only=True)
class Stage:
    """``database`` : a SQLite file or a PostgreSQL URL; ``value`` : what the recipe returned."""

    database: Path | str
    files: Path
    value: Any


class Stages:
    """What the recipes of one test process have made, by recipe and kind of database."""

    def __init__(self, folder: Path):
        self._folder = folder
        self._kept: dict[tuple, Stage] = {}

    def bring(self, house: House, server: PostgresServer | None, recipe: Callable, arguments: dict) -> Any:
        """Bring a new house to where the recipe leaves it, and return what the recipe returns."""
        assert _is_new(house), "a stage takes the place of all that a house holds: ask for it first"
        defaults = {each.name: each.default for each in signature(recipe).parameters.values()}
        key = (server is None, recipe, repr(sorted((defaults | arguments).items())))
        if key in self._kept:
            _restore(house, server, self._kept[key])
        else:
            self._kept[key] = self._keep(house, server, recipe(house, **arguments))
        return copy.deepcopy(self._kept[key].value)

    def _keep(self, house: House, server: PostgresServer | None, value: Any) -> Stage:
        house.database.dispose()
        folder = self._folder / str(len(self._kept))
        _copy_files(house.folder, folder)
        if server is None:
            database = shutil.copy(_sqlite_file(house), folder / "stilb.sqlite")
        else:
            database = server.new_database(like=_url(house))
        return Stage(database=database, files=folder, value=copy.deepcopy(value))


def _restore(house: House, server: PostgresServer | None, stage: Stage) -> None:
    house.database.dispose()
    _copy_files(stage.files, house.folder)
    if server is None:
        shutil.copy(stage.database, _sqlite_file(house))
    else:
        server.replace_database(_url(house), like=stage.database)


def _copy_files(source: Path, target: Path) -> None:
    target.mkdir(parents=True, exist_ok=True)
    for name in ("blobs", "uploads"):
        if (source / name).exists():
            shutil.copytree(source / name, target / name, dirs_exist_ok=True)


def _is_new(house: House) -> bool:
    with house.database.reading() as session:
        asked = select(func.count()).select_from(AuditEntry).where(AuditEntry.actor != "test")
        return session.scalar(asked) == 0


def _sqlite_file(house: House) -> Path:
    path = Path(house.database.url.database)
    # with the last connection everything has gone into the one file
    assert not path.with_name(f"{path.name}-wal").exists()
    return path


def _url(house: House) -> str:
    return house.database.url.render_as_string(hide_password=False)


@pytest.fixture(scope="session")
def stages(tmp_path_factory):
    return Stages(tmp_path_factory.mktemp("stages"))


@pytest.fixture
def staged(request, house, stages):
    """`staged(recipe, ...)` does to the house what `recipe(house, ...)` does, and returns the same."""
    server = None if house.database.is_sqlite else request.getfixturevalue("postgres")

    def bring(recipe, **arguments):
        return stages.bring(house, server, recipe, arguments)

    house.stage = bring
    return bring
