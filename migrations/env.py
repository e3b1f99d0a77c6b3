"""Alembic's environment: store.migrate hands its connection in; `alembic current` in a checkout makes one."""

from alembic import context
from alembic.util import CommandError
from sqlalchemy import Connection

from store.database import Database
from store.settings import read_settings
from store.tables import Base

_CHANGING = ("upgrade", "downgrade", "stamp")


def run(connection: Connection) -> None:
    """Run the command that was asked for on this connection."""
    context.configure(
        connection=connection, target_metadata=Base.metadata, render_as_batch=True, compare_type=True
    )
    context.run_migrations()


handed = context.config.attributes.get("connection")
if handed is not None:
    run(handed)
elif context.config.cmd_opts is not None and context.config.cmd_opts.cmd[0].__name__ in _CHANGING:
    raise CommandError(
        "change the schema with `stilb-server migrate`, which also writes what follows from rows"
    )
else:
    database = Database(read_settings().effective_database_url)
    with database.engine.connect() as own:
        run(own)
    database.dispose()
