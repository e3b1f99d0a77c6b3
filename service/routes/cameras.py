"""Cameras."""

from fastapi import APIRouter, Request, Response
from sqlalchemy import select
from sqlalchemy.orm import Session

from service.auth import Calibrator, Reader
from service.context import UsesContext
from service.lookup import Id, owned
from service.paging import Cursor, Limit, Page, page
from service.routes import problems
from service.schemas.equipment import CameraAnswer, NewCamera
from service.writing import Reply, Writes
from store.queries.equipment import find_or_add_camera
from store.tables import Camera

router = APIRouter(prefix="/v1/cameras", tags=["cameras"])


@router.post(
    "",
    status_code=201,
    response_model=CameraAnswer,
    responses={200: {"model": CameraAnswer, "description": "It was registered already."}, **problems()},
)
def create_camera(body: NewCamera, caller: Calibrator, writing: Writes) -> Response:
    """Register a camera body, with the names that it writes into its files."""
    columns = body.model_dump(exclude={"lens"})
    if body.lens is not None:
        columns |= {f"lens_{name}": value for name, value in body.lens.model_dump().items()}

    def change(session: Session) -> Reply:
        camera, new = find_or_add_camera(session, caller.organisation_id, columns)
        return Reply(status=201 if new else 200, body=CameraAnswer.of(camera))

    return writing.run(caller, change)


@router.get("", response_model=Page[CameraAnswer], responses=problems())
def list_cameras(
    request: Request, caller: Reader, context: UsesContext, limit: Limit = 100, cursor: Cursor = None
) -> Response:
    """The cameras of your organisation, oldest first."""
    rows = select(Camera).where(Camera.organisation_id == caller.organisation_id)
    with context.database.reading() as session:
        return page(
            session,
            request,
            rows,
            by=Camera.id,
            limit=limit,
            cursor=cursor,
            shape=lambda found: [CameraAnswer.of(row) for row in found],
        )


@router.get("/{camera_id}", response_model=CameraAnswer, responses=problems(404))
def get_camera(camera_id: Id, caller: Reader, context: UsesContext) -> Response:
    """One camera."""
    with context.database.reading() as session:
        return CameraAnswer.of(owned(session, Camera, camera_id, caller)).respond()
