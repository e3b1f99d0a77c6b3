"""The application: routes, problems, and an OpenAPI document that says exactly what they do."""

import logging
from typing import Any

from fastapi import FastAPI, Request, Response
from fastapi.openapi.utils import get_openapi
from fastapi.routing import APIRoute
from sqlalchemy.exc import OperationalError

from service import problems
from service.context import Context
from service.problems import HttpCode, Problem
from service.routes import include_routes

API_VERSION = "1"


def build_app(context: Context) -> FastAPI:
    """Put the application together around what it needs of the world."""
    app = FastAPI(
        title="stilb",
        version=API_VERSION,
        summary="Raw frames and meter readings in, camera coefficients with their uncertainty out.",
        generate_unique_id_function=_operation_id,
    )
    app.state.context = context
    problems.install(app)
    _install_database_problem(app)
    include_routes(app)
    app.openapi = lambda: _openapi(app)  # type: ignore[method-assign]
    return app


def _operation_id(route: APIRoute) -> str:
    return route.name


def _install_database_problem(app: FastAPI) -> None:
    @app.exception_handler(OperationalError)
    async def unavailable(_request: Request, error: OperationalError) -> Response:
        logging.getLogger(__name__).warning("the database does not answer: %s", error.orig)
        problem = Problem(
            503,
            HttpCode.DATABASE_UNAVAILABLE,
            "The database does not answer just now. Try again.",
            retryable=True,
            headers={"Retry-After": "1"},
        )
        return problems.answer(problem)


def _openapi(app: FastAPI) -> dict[str, Any]:
    """FastAPI's document, made true: absent is absent, and a wrong field is our problem, not its own."""
    if app.openapi_schema is None:
        document = get_openapi(title=app.title, version=app.version, summary=app.summary, routes=app.routes)
        for operation in (op for path in document["paths"].values() for op in path.values()):
            _drop_json_from_problems(operation)
        for name in ("HTTPValidationError", "ValidationError"):
            document["components"]["schemas"].pop(name, None)
        _absent_is_not_null(document)
        app.openapi_schema = document
    return app.openapi_schema


def _drop_json_from_problems(operation: dict[str, Any]) -> None:
    for status, answer in operation["responses"].items():
        content = answer.get("content", {})
        if "application/problem+json" in content:
            content.pop("application/json", None)
            content["application/problem+json"] = {
                "schema": {"$ref": "#/components/schemas/ProblemAnswer"},
                "example": problems.problem_body(int(status), "not_found", "What was wrong and what to do."),
            }


def _absent_is_not_null(node: Any) -> None:  # noqa: ANN401
    """Say of an optional field what it holds when it is there: null is never sent, and never taken."""
    if isinstance(node, list):
        for member in node:
            _absent_is_not_null(member)
    if not isinstance(node, dict):
        return
    options = node.get("anyOf", [])
    kept = [option for option in options if option != {"type": "null"}]
    if len(kept) < len(options) and not node.pop("nullable_on_purpose", False):
        if len(kept) == 1:
            del node["anyOf"]
            node.update({**kept[0], **node})
        else:
            node["anyOf"] = kept
        if node.get("default", "") is None:
            del node["default"]
    for member in node.values():
        _absent_is_not_null(member)
