"""The application: routes, problems, and the document that says what they do."""

import logging
from threading import Lock
from typing import Any

from fastapi import FastAPI, Request, Response
from fastapi.middleware.cors import CORSMiddleware
from fastapi.routing import APIRoute
from sqlalchemy.exc import InterfaceError, OperationalError, ProgrammingError, SQLAlchemyError
from sqlalchemy.exc import TimeoutError as NoConnectionFree
from starlette.concurrency import run_in_threadpool

from radiometry.findings import interface
from service import problems
from service.addresses import Addresses
from service.compression import Compression
from service.context import Context
from service.deprecated import Deprecations
from service.digests import ContentDigests
from service.document import Document, build_document
from service.heads import Heads
from service.hosts import KnownHosts
from service.limits import BodyLimit
from service.overridden import OverriddenMethods
from service.problems import Problem
from service.routes import include_routes
from service.shutdown import CarriesTraffic
from service.web import problem_pages
from service.web.assets import Assets
from service.web.headers import SecurityHeaders
from service.web.pages import include_pages
from service.web.rendering import build_environment
from store.database import (
    Database,
    SchemaDiffers,
    is_about_missing_parts,
    is_full,
    require_own_schema,
    summarise,
)
from store.software import read_version

_SHOWN = [
    *("Content-Disposition", "Content-Range", "Deprecation", "ETag", "Link", "Preference-Applied"),
    *("Retry-After", "Sunset", "X-Request-ID"),
]
"""Headers of answers that a page of another origin may read: those that its requests go by."""

log = logging.getLogger(__name__)


def build_app(context: Context) -> FastAPI:
    """Put the application together around what it needs of the world."""
    app = FastAPI(
        title="stilb",
        version=read_version(),
        summary="Raw frames and meter readings in, camera coefficients with their uncertainty out.",
        generate_unique_id_function=_operation_id,
        # FastAPI's own pages load their scripts from elsewhere: service/web/pages/documents.py has ours
        docs_url=None,
        redoc_url=None,
        openapi_url=None,
    )
    app.add_middleware(BodyLimit)
    app.add_middleware(ContentDigests)
    app.add_middleware(Compression)
    _let_dashboards_read(app, context.settings.cors_origins)
    app.add_middleware(Heads)
    app.add_middleware(Deprecations)
    app.add_middleware(OverriddenMethods)
    app.add_middleware(KnownHosts)
    app.add_middleware(SecurityHeaders)
    # the outermost: it answers in the place of all others
    app.add_middleware(CarriesTraffic)
    app.state.context = context
    app.state.operations = {}
    app.state.assets = Assets()
    app.state.templates = build_environment(app.state.assets)
    problems.install(app)
    _install_database_problem(app)
    problem_pages.install(app)
    include_routes(app)
    include_pages(app)
    app.state.addresses = Addresses(app)
    _publish_document(app)
    return app


def _publish_document(app: FastAPI) -> None:
    building = Lock()

    def openapi() -> dict[str, Any]:
        # a page asks for many things at once, and the first of them may be the first requests at all
        with building:
            return build_document(app)

    app.openapi = openapi  # type: ignore[method-assign]
    app.state.document = Document(app)


def _let_dashboards_read(app: FastAPI, origins: str) -> None:
    """Pages of the listed origins may read with a key of their own; no cookie of ours goes with it."""
    allowed = [origin.strip().rstrip("/") for origin in origins.split(",") if origin.strip()]
    if allowed:
        app.add_middleware(
            CORSMiddleware,
            allow_origins=allowed,
            allow_methods=["GET", "HEAD"],
            allow_headers=["Authorization", "If-None-Match", "Prefer"],
            expose_headers=_SHOWN,
            max_age=3600,
        )


def _operation_id(route: APIRoute) -> str:
    return route.name


def _install_database_problem(app: FastAPI) -> None:
    @app.exception_handler(OperationalError)
    @app.exception_handler(ProgrammingError)
    @app.exception_handler(InterfaceError)
    @app.exception_handler(NoConnectionFree)
    @app.exception_handler(SchemaDiffers)
    async def unavailable(request: Request, error: SQLAlchemyError) -> Response:
        if isinstance(error, (OperationalError, ProgrammingError)) and is_about_missing_parts(error):
            # Our own mistake, unless the schema was changed under us.
            differs = await run_in_threadpool(_find_other_schema, request.app.state.context.database)
            if differs is None:
                raise error
            error = differs
        log.warning("the database cannot be used: %s", summarise(error))
        if is_full(error):
            detail = "The service has no space left to store this. Try again later."
            return problems.answer(Problem(interface.STORAGE_FULL, detail, headers={"Retry-After": "10"}))
        if isinstance(error, SchemaDiffers):
            code, detail = (
                interface.SCHEMA_MISMATCH,
                "The database has the schema of another version. Try again later.",
            )
        else:
            code, detail = interface.DATABASE_UNAVAILABLE, "The database does not answer. Try again."
        return problems.answer(Problem(code, detail, headers={"Retry-After": "1"}))


def _find_other_schema(database: Database) -> SchemaDiffers | None:
    try:
        with database.reading() as session:
            require_own_schema(session)
    except SchemaDiffers as found:
        return found
    return None
