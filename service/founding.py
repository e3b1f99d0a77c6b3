"""First contents of a database: the operator with the first key, and true counts."""

from sqlalchemy import func, select

from service.auth import SCOPES
from store.database import Database
from store.queries.organisations import ensure_operator
from store.queries.usage import recount_all

_TURN = 0x7374696C62


def found(database: Database, secret: str) -> None:
    """Make the operator, the first key and the counts unless they exist, one service after the other."""
    with database.writing("service") as session:
        if not database.is_sqlite:
            session.execute(select(func.pg_advisory_xact_lock(_TURN)))
        if secret:
            ensure_operator(session, secret, list(SCOPES))
        recount_all(session)
