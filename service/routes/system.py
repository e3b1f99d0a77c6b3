"""Whether the service lives and can serve."""

import shutil

from fastapi import APIRouter, Response
from fastapi.responses import PlainTextResponse
from pydantic import ConfigDict
from sqlalchemy import text as sql
from sqlalchemy.exc import SQLAlchemyError

from service.context import UsesContext
from service.metrics import render
from service.problems import HttpCode, Problem
from service.routes import problems
from service.schemas.base import Answer
from service.stopping import stopping
from store.blobs import StorageFull, StorageUnavailable
from store.queries.census import take_census

router = APIRouter(tags=["system"])


class Health(Answer):
    model_config = ConfigDict(json_schema_extra={"examples": [{"status": "ok"}]})

    status: str


@router.get("/livez", response_model=Health)
async def get_livez() -> Response:
    """The process answers: without a thread or the database, for which others may wait."""
    return Health(status="ok").respond()


@router.get("/readyz", response_model=Health, responses={503: problems()[503]})
def get_readyz(context: UsesContext) -> Response:
    """The database and the file store answer too: requests can be served."""
    if context.traffic.stopping:
        raise stopping()
    try:
        with context.database.reading() as session:
            session.execute(sql("SELECT 1"))
        context.blobs.check()
    except SQLAlchemyError as error:
        raise Problem(
            503, HttpCode.DATABASE_UNAVAILABLE, "The database does not answer.", retryable=True
        ) from error
    except (StorageFull, StorageUnavailable) as error:
        raise Problem(503, HttpCode.STORAGE_UNAVAILABLE, str(error), retryable=True) from error
    return Health(status="ok").respond()


@router.get(
    "/metrics",
    response_class=PlainTextResponse,
    responses={
        503: problems()[503],
        200: {"content": {"text/plain": {"example": "stilb_oldest_queued_job_age_seconds 0\n"}}},
    },
)
def get_metrics(context: UsesContext) -> PlainTextResponse:
    """Jobs, frames and versions, counted for Prometheus; the version; the room on the disk."""
    free_bytes = shutil.disk_usage(context.settings.data).free
    with context.database.reading() as session:
        text = render(take_census(session), free_bytes=free_bytes)
    return PlainTextResponse(text, media_type="text/plain; version=0.0.4")
