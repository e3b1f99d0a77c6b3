"""One file a resource: from HTTP to queries and back."""

from typing import Any

from fastapi import FastAPI
from fastapi.routing import APIRoute

from service.ready import ReadyAnswers

_MEANINGS = {
    400: "The body cannot be read.",
    401: "No key, or none that is known.",
    403: "The key lacks a scope.",
    404: "There is no such thing for this key's organisation.",
    409: "It contradicts what is recorded.",
    412: "A condition in a header cannot be met, or an upload does not speak tus 1.0.0.",
    413: "The body is too large.",
    500: "The stored file is damaged or missing; the same upload heals it.",
    415: "The body has another media type than is taken here, or it is compressed (`content_encoded`).",
    416: "The range lies behind the end of the file.",
    422: "A field is wrong, or what was sent cannot be used; the problem says what and why.",
    429: "Too much at once, or more than your organisation may have; wait as `Retry-After` says.",
    460: "A piece of a file is not the one that was announced.",
    503: "A part of the service does not answer just now; try again.",
    507: "There is no room left.",
}


def problems(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """Document the problems of a route; those that any route with a key can give are always among them."""
    return {
        status: {
            "description": _MEANINGS[status],
            "content": {"application/problem+json": {}},
        }
        for status in sorted({401, 403, 422, 429, 503, *statuses})
    }


UNCHANGED: dict[int | str, dict[str, Any]] = {304: {"description": "You have it already."}}


def sends_file(media_type: str) -> dict[int | str, dict[str, Any]]:
    """Document a route that sends a file with an ETag."""
    schema = {"type": "string", "format": "binary"}
    if media_type.startswith("text/"):
        schema = {"type": "string"}
    elif media_type.endswith("json"):
        schema = {"type": "object"}
    return {200: {"content": {media_type: {"schema": schema}}}, **UNCHANGED, **problems(404)}


def sends_stored_file(media_type: str) -> dict[int | str, dict[str, Any]]:
    """Document a route that sends what the file store keeps, which a disk may have lost."""
    part = {media_type: {"schema": {"type": "string", "format": "binary"}}}
    return {
        **sends_file(media_type),
        206: {"description": "The part that `Range` asks for.", "content": part},
        **problems(404, 416, 500),
    }


def include_routes(app: FastAPI) -> None:
    """Hang every resource into the application."""
    from service.proposals import routes as proposals  # noqa: PLC0415
    from service.routes import (  # noqa: PLC0415  the routes import this module's problems()
        audit,
        calibrations,
        cameras,
        campaigns,
        certificates,
        checklist,
        coefficients,
        comparisons,
        crops,
        events,
        exports,
        findings,
        fleet,
        frames,
        grid,
        history,
        jobs,
        keys,
        known,
        looks,
        manifests,
        map_tools,
        map_values,
        measurement_lists,
        measurements,
        meters,
        methods,
        motion,
        organisation,
        panels,
        points,
        readings,
        recalls,
        reports,
        rigs,
        sessions,
        system,
        thumbnails,
        tools,
        uploads,
    )

    for usual in coefficients.ready_router.routes:
        if isinstance(usual, APIRoute):
            app.router.routes.append(ReadyAnswers(usual))
    app.include_router(coefficients.ready_router)
    app.include_router(system.probes)
    app.include_router(manifests.keys_router)
    for module in (
        system,
        keys,
        sessions,
        cameras,
        meters,
        panels,
        campaigns,
        readings,
        points,
        known,
        proposals,
        map_tools,
        map_values,
        frames,
        grid,
        uploads,
        looks,
        thumbnails,
        crops,
        manifests,
        calibrations,
        methods,
        exports,
        findings,
        coefficients,
        comparisons,
        fleet,
        rigs,
        measurement_lists,
        measurements,
        reports,
        events,
        jobs,
        checklist,
        certificates,
        organisation,
        audit,
        history,
        recalls,
        motion,
        tools,
    ):
        app.include_router(module.router)
