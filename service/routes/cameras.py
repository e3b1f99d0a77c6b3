"""Cameras."""

from typing import Annotated, Any

from fastapi import Query, Request, Response
from sqlalchemy import select
from sqlalchemy.orm import Session

from service.auth import Calibrator, Reader
from service.changes import Reply, Writes
from service.context import UsesContext
from service.lookup import Id, owned
from service.operations import Router
from service.paging import Listing, Page, page_own
from service.problems import invalid
from service.routes import problems
from service.schemas.base import Text
from service.schemas.equipment import CameraAnswer, CameraChange, NewCamera
from store.queries.campaigns import check_again
from store.queries.organisations import find_or_add_camera
from store.tables import Camera, Campaign

router = Router(prefix="/v1/cameras", tags=["cameras"])


@router.post(
    "",
    status_code=201,
    response_model=CameraAnswer,
    responses={200: {"model": CameraAnswer, "description": "It was registered already."}, **problems()},
)
def create_camera(body: NewCamera, caller: Calibrator, writing: Writes) -> Response:
    """Register a camera body, with the names that it writes into its files."""
    columns = _columns(body)

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


@router.patch("/{camera_id}", response_model=CameraAnswer, responses=problems(404))
def change_camera(camera_id: Id, body: CameraChange, caller: Calibrator, writing: Writes) -> Response:
    """Correct a camera's names, lens or sensor. With other names its campaigns' frames are checked again."""

    def change(session: Session) -> Reply:
        camera = owned(session, Camera, camera_id, caller)
        before = _names(camera)
        for name, value in _columns(body).items():
            setattr(camera, name, None if value == "" else value)
        jobs = []
        if _names(camera) != before:
            names = dict(zip(("make", "model", "serial"), _names(camera), strict=True))
            own = select(Camera.id).filter_by(organisation_id=caller.organisation_id, **names)
            with session.no_autoflush:
                if session.scalar(own.where(Camera.id != camera.id)):
                    message = "is that of another camera of yours: move the campaign to it"
                    raise invalid([{"type": "camera", "loc": ("body", "serial"), "msg": message}])
            mine = select(Campaign).where(Campaign.camera_id == camera.id, Campaign.archived_at.is_(None))
            campaigns = session.scalars(mine.order_by(Campaign.id)).all()
            jobs = [job for each in campaigns for job in check_again(session, each, by=caller.key_id)]
        session.flush()
        return Reply(status=200, body=CameraAnswer.of(camera), jobs=jobs)

    return writing.run(caller, change)


def _columns(body: NewCamera | CameraChange) -> dict[str, Any]:
    columns = body.model_dump(exclude={"lens"}, exclude_none=True)
    if body.lens is not None:
        columns |= {f"lens_{name}": value for name, value in body.lens.model_dump().items()}
    return columns


def _names(camera: Camera) -> tuple[str, str, str]:
    return camera.make, camera.model, camera.serial
