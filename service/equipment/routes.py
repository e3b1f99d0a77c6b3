"""Cameras, meters and panels."""

from typing import Annotated, Any

from fastapi import Query, Request, Response
from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.findings import interface
from service.equipment.schemas import (
    CameraAnswer,
    CameraChange,
    MeterAnswer,
    NewCamera,
    NewMeter,
    NewPanel,
    PanelAnswer,
)
from service.http.answers import problems
from service.http.auth import Calibrator, Reader
from service.http.changes import Reply, Writes
from service.http.context import UsesContext
from service.http.lookup import Id, owned
from service.http.models import Text
from service.http.operations import Router
from service.http.paging import Listing, Page, page_own
from service.http.problems import Problem, invalid
from store.queries.campaigns import check_again
from store.queries.organisations import find_or_add_camera, find_or_add_meter, find_or_add_panel
from store.tables import Camera, Campaign, Meter, Panel

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


meters_router = Router(prefix="/v1/meters", tags=["meters"])


@meters_router.post(
    "",
    status_code=201,
    response_model=MeterAnswer,
    responses={
        200: {
            "model": MeterAnswer,
            "description": "It was registered already; a certificate sent now is its newest.",
        },
        **problems(),
    },
)
def create_meter(body: NewMeter, caller: Calibrator, writing: Writes) -> Response:
    """Register a meter, with its calibration certificate where there is one."""

    def change(session: Session) -> Reply:
        meter, new = find_or_add_meter(session, caller.organisation_id, body.columns())
        return Reply(status=201 if new else 200, body=MeterAnswer.of(meter))

    return writing.run(caller, change)


class MeterListing(Listing):
    kind: Text | None = None
    serial: Text | None = None


@meters_router.get("", response_model=Page[MeterAnswer], responses=problems())
def list_meters(
    request: Request, caller: Reader, context: UsesContext, listing: Annotated[MeterListing, Query()]
) -> Response:
    """The meters of your organisation, oldest first."""
    return page_own(request, context, caller, Meter, listing, MeterAnswer.of)


@meters_router.get("/{meter_id}", response_model=MeterAnswer, responses=problems(404))
def get_meter(meter_id: Id, caller: Reader, context: UsesContext) -> Response:
    """One meter."""
    with context.database.reading() as session:
        return MeterAnswer.of(owned(session, Meter, meter_id, caller)).respond()


panels_router = Router(prefix="/v1/panels", tags=["panels"])


@panels_router.post(
    "",
    status_code=201,
    response_model=PanelAnswer,
    responses={
        200: {"model": PanelAnswer, "description": "It was registered already, with the same figures."},
        **problems(409),
    },
)
def create_panel(body: NewPanel, caller: Calibrator, writing: Writes) -> Response:
    """Register a panel as it was measured on a day. Measured again, it is another entry."""

    def change(session: Session) -> Reply:
        values = body.columns()
        panel, new = find_or_add_panel(session, caller.organisation_id, values)
        if panel.bands != values["bands"]:
            raise Problem(
                interface.PANEL_DIFFERS,
                f"Panel {panel.serial} as measured on {panel.measured_on} is registered with other values: "
                "a measurement does not change. Send the day of the new measurement with the new figures.",
            )
        return Reply(status=201 if new else 200, body=PanelAnswer.restate(panel))

    return writing.run(caller, change)


class PanelListing(Listing):
    serial: Text | None = None


@panels_router.get("", response_model=Page[PanelAnswer], responses=problems())
def list_panels(
    request: Request, caller: Reader, context: UsesContext, listing: Annotated[PanelListing, Query()]
) -> Response:
    """The panels of your organisation, oldest entry first."""
    return page_own(request, context, caller, Panel, listing, PanelAnswer.restate)


@panels_router.get("/{panel_id}", response_model=PanelAnswer, responses=problems(404))
def get_panel(panel_id: Id, caller: Reader, context: UsesContext) -> Response:
    """One panel as it was measured on a day."""
    with context.database.reading() as session:
        return PanelAnswer.restate(owned(session, Panel, panel_id, caller)).respond()
