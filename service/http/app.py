"""The application: middleware, routes, problems, and the document that says what they do."""

import logging
from threading import Lock
from typing import Any, Final

from fastapi import FastAPI, Request, Response
from fastapi.middleware.cors import CORSMiddleware
from sqlalchemy.exc import InterfaceError, OperationalError, ProgrammingError, SQLAlchemyError
from sqlalchemy.exc import TimeoutError as NoConnectionFree
from starlette.concurrency import run_in_threadpool

from radiometry.findings import interface
from service.calibrations import fleet, history, methods
from service.calibrations import routes as calibrations
from service.campaigns import grid, manifests, points, proposals, readings
from service.campaigns import routes as campaigns
from service.coefficients import routes as coefficients
from service.documents import issuing, report, road
from service.equipment import routes as equipment
from service.frames import pictures
from service.frames import routes as frames
from service.http import answers, document, middleware, problems
from service.http.context import Context
from service.http.problems import Problem
from service.jobs import routes as jobs
from service.measurements import exports, isolines
from service.measurements import routes as measurements
from service.organisation import routes as organisation
from service.pages import cameras, documentation, rendering
from service.pages import routes as pages
from service.roads import routes as roads
from service.system import routes as system
from service.tools import routes as tools
from service.uploads import routes as uploads
from store import database, software

PAGES: Final = (rendering.router, pages.sign_in_router, documentation.router, cameras.router, pages.router)
ROUTERS: Final = (
    *(coefficients.ready_router, system.probes, manifests.keys_router),
    *(system.router, organisation.keys_router, organisation.sessions_router),
    *(equipment.router, equipment.meters_router, equipment.panels_router),
    *(campaigns.router, readings.router, points.router, uploads.known_router, proposals.router),
    *(isolines.router, exports.router, frames.router, grid.router, uploads.router),
    *(pictures.router, pictures.thumbnails_router, manifests.router),
    *(calibrations.router, methods.router, calibrations.exports_router, methods.findings_router),
    coefficients.router,
    *(measurements.comparisons_router, fleet.router, equipment.rigs_router),
    *(measurements.router, report.router, roads.router, roads.rules_router, road.router),
    *(jobs.events_router, jobs.router, campaigns.checklist_router, issuing.router),
    *(organisation.router, organisation.audit_router, history.router, history.recalls_router),
    *(frames.motion_router, tools.router),
    *PAGES,
)

_SHOWN = [
    *("Content-Disposition", "Content-Range", "ETag", "Link", "Preference-Applied"),
    *("Retry-After", "X-Request-ID"),
]
"""Headers of answers that a page of another origin may read: those that its requests go by."""

log = logging.getLogger(__name__)


def build_app(context: Context) -> FastAPI:
    app = FastAPI(
        title="stilb",
        version=software.read_version(),
        summary="Raw frames and meter readings in, camera coefficients with their uncertainty out.",
        # as the routers have built them: to include a router is to build each of its routes again
        routes=[route for router in ROUTERS for route in router.routes],
        # FastAPI's own pages load their scripts from elsewhere: service/pages/documentation.py has ours
        docs_url=None,
        redoc_url=None,
        openapi_url=None,
    )
    app.add_middleware(middleware.BodyLimit)
    app.add_middleware(middleware.Compression)
    _let_dashboards_read(app, context.settings.cors_origins)
    app.add_middleware(middleware.Heads)
    app.add_middleware(middleware.OverriddenMethods)
    app.add_middleware(middleware.KnownHosts)
    app.add_middleware(middleware.SecurityHeaders)
    # the outermost: it answers in the place of all others
    app.add_middleware(middleware.CarriesTraffic)
    app.state.context = context
    app.state.operations = {}
    app.state.assets = rendering.Assets()
    app.state.templates = rendering.build_environment(app.state.assets)
    problems.install(app)
    answers.install(app)
    _install_database_problem(app)
    rendering.install(app)
    app.state.addresses = middleware.Addresses(app)
    _publish_document(app)
    return app


def _publish_document(app: FastAPI) -> None:
    building = Lock()

    def openapi() -> dict[str, Any]:
        # a page asks for many things at once, and the first of them may be the first requests at all
        with building:
            return document.build_document(app)

    app.openapi = openapi  # type: ignore[method-assign]
    app.state.document = document.Document(app)


def _let_dashboards_read(app: FastAPI, origins: str) -> None:
    """Pages of the listed origins may read with a key of their own; no cookie of ours goes with it."""
    if allowed := [origin.strip().rstrip("/") for origin in origins.split(",") if origin.strip()]:
        app.add_middleware(
            CORSMiddleware,
            allow_origins=allowed,
            allow_methods=["GET", "HEAD"],
            allow_headers=["Authorization", "If-None-Match", "Prefer"],
            expose_headers=_SHOWN,
            max_age=3600,
        )


def _install_database_problem(app: FastAPI) -> None:
    @app.exception_handler(OperationalError)
    @app.exception_handler(ProgrammingError)
    @app.exception_handler(InterfaceError)
    @app.exception_handler(NoConnectionFree)
    @app.exception_handler(database.SchemaDiffers)
    async def unavailable(request: Request, error: SQLAlchemyError) -> Response:
        if isinstance(error, (OperationalError, ProgrammingError)) and database.is_about_missing_parts(error):
            # Our own mistake, unless the schema was changed under us.
            differs = await run_in_threadpool(_find_other_schema, request.app.state.context.database)
            if differs is None:
                raise error
            error = differs
        log.warning("the database cannot be used: %s", database.summarise(error))
        if database.is_full(error):
            detail = "The service has no space left to store this. Try again later."
            return problems.answer(Problem(interface.STORAGE_FULL, detail, headers={"Retry-After": "10"}))
        code, detail = interface.DATABASE_UNAVAILABLE, "The database does not answer. Try again."
        if isinstance(error, database.SchemaDiffers):
            code = interface.SCHEMA_MISMATCH
            detail = "The database has the schema of another version. Try again later."
        return problems.answer(Problem(code, detail, headers={"Retry-After": "1"}))


def _find_other_schema(asked: database.Database) -> database.SchemaDiffers | None:
    try:
        with asked.reading() as session:
            database.require_own_schema(session)
    except database.SchemaDiffers as found:
        return found
    return None
