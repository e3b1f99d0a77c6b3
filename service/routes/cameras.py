"""Cameras."""

from typing import Annotated

from fastapi import APIRouter, Query, Request, Response
from sqlalchemy.orm import Session

from service.auth import Calibrator, Reader
from service.changes import Reply, Writes
from service.context import UsesContext
from service.lookup import Id, owned
from service.paging import Listing, Page, page_own
from service.routes import problems
from service.schemas.base import Text
from service.schemas.equipment import CameraAnswer, NewCamera
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


class CameraListing(Listing):
    make: Text | None = None
    model: Text | None = None
    serial: Text | None = None


@router.get("", response_model=Page[CameraAnswer], responses=problems())
def list_cameras(
    request: Request, caller: Reader, context: UsesContext, listing: Annotated[CameraListing, Query()]
) -> Response:
    """The cameras of your organisation, oldest first."""
    return page_own(request, context, caller, Camera, listing, CameraAnswer.of)


@router.get("/{camera_id}", response_model=CameraAnswer, responses=problems(404))
def get_camera(camera_id: Id, caller: Reader, context: UsesContext) -> Response:
    """One camera."""
    with context.database.reading() as session:
        return CameraAnswer.of(owned(session, Camera, camera_id, caller)).respond()
