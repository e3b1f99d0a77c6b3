"""Whether the service lives and can serve."""

from typing import Any

from fastapi import APIRouter
from pydantic import ConfigDict
from sqlalchemy import text
from sqlalchemy.exc import SQLAlchemyError

from service.context import UsesContext
from service.problems import HttpCode, Problem
from service.routes import problems
from service.schemas.base import Answer
from store.blobs import StorageFull, StorageUnavailable

router = APIRouter(tags=["system"])


class Health(Answer):
    model_config = ConfigDict(json_schema_extra={"examples": [{"status": "ok"}]})

    status: str


@router.get("/livez", response_model=Health)
def get_livez() -> Any:  # noqa: ANN401
    """The process answers."""
    return Health(status="ok").dump()


@router.get("/readyz", response_model=Health, responses={503: problems()[503]})
def get_readyz(context: UsesContext) -> Any:  # noqa: ANN401
    """The database and the file store answer too: requests can be served."""
    try:
        with context.database.reading() as session:
            session.execute(text("SELECT 1"))
        context.blobs.check()
    except SQLAlchemyError as error:
        raise Problem(
            503, HttpCode.DATABASE_UNAVAILABLE, "The database does not answer.", retryable=True
        ) from error
    except (StorageFull, StorageUnavailable) as error:
        raise Problem(503, HttpCode.STORAGE_UNAVAILABLE, str(error), retryable=True) from error
    return Health(status="ok").dump()
