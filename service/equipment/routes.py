"""Cameras, meters and panels."""

from typing import Annotated, Any

from fastapi import Query, Request, Response
from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.findings import interface
from service.equipment import schemas
from service.http import answers, auth, changes, lookup, models, operations, paging
from service.http.context import UsesContext
from service.http.problems import Problem, invalid
from store.queries.campaigns import check_again
from store.queries.organisations import find_or_add_camera, find_or_add_meter, find_or_add_panel
from store.tables import Camera, Campaign, Meter, Panel

router = operations.Router(prefix="/v1/cameras", tags=["cameras"])


@router.post(
    "",
    status_code=201,
    response_model=schemas.CameraAnswer,
    responses={
        200: {"model": schemas.CameraAnswer, "description": "It was registered already."},
        **answers.problems(),
    },
)
def create_camera(body: schemas.NewCamera, caller: auth.Calibrator, writing: changes.Writes) -> Response:
    """Register a camera body, with the names that it writes into its files."""
    columns = _columns(body)

    def change(session: Session) -> changes.Reply:
        camera, new = find_or_add_camera(session, caller.organisation_id, columns)
        return changes.Reply(status=201 if new else 200, body=schemas.CameraAnswer.of(camera))

    return writing.run(caller, change)


class CameraListing(paging.Listing):
    make: models.Text | None = None
    model: models.Text | None = None
    serial: models.Text | None = None


@router.get("", response_model=paging.Page[schemas.CameraAnswer], responses=answers.problems())
def list_cameras(
    request: Request, caller: auth.Reader, context: UsesContext, listing: Annotated[CameraListing, Query()]
) -> Response:
    """The cameras of your organisation, oldest first."""
    return paging.page_own(request, context, caller, Camera, listing, schemas.CameraAnswer.of)


@router.get("/{camera_id}", response_model=schemas.CameraAnswer, responses=answers.problems(404))
def get_camera(camera_id: lookup.Id, caller: auth.Reader, context: UsesContext) -> Response:
    """One camera."""
    with context.database.reading() as session:
        return schemas.CameraAnswer.of(lookup.owned(session, Camera, camera_id, caller)).respond()


@router.patch("/{camera_id}", response_model=schemas.CameraAnswer, responses=answers.problems(404))
def change_camera(
    camera_id: lookup.Id, body: schemas.CameraChange, caller: auth.Calibrator, writing: changes.Writes
) -> Response:
    """Correct a camera's names, lens or sensor. With other names its campaigns' frames are checked again."""

    def change(session: Session) -> changes.Reply:
        camera = lookup.owned(session, Camera, camera_id, caller)
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
        return changes.Reply(status=200, body=schemas.CameraAnswer.of(camera), jobs=jobs)

    return writing.run(caller, change)


def _columns(body: schemas.NewCamera | schemas.CameraChange) -> dict[str, Any]:
    columns = body.model_dump(exclude={"lens"}, exclude_none=True)
    if body.lens is not None:
        columns |= {f"lens_{name}": value for name, value in body.lens.model_dump().items()}
    return columns


def _names(camera: Camera) -> tuple[str, str, str]:
    return camera.make, camera.model, camera.serial


meters_router = operations.Router(prefix="/v1/meters", tags=["meters"])


@meters_router.post(
    "",
    status_code=201,
    response_model=schemas.MeterAnswer,
    responses={
        200: {
            "model": schemas.MeterAnswer,
            "description": "It was registered already; a certificate sent now is its newest.",
        },
        **answers.problems(),
    },
)
def create_meter(body: schemas.NewMeter, caller: auth.Calibrator, writing: changes.Writes) -> Response:
    """Register a meter, with its calibration certificate where there is one."""

    def change(session: Session) -> changes.Reply:
        meter, new = find_or_add_meter(session, caller.organisation_id, body.columns())
        return changes.Reply(status=201 if new else 200, body=schemas.MeterAnswer.of(meter))

    return writing.run(caller, change)


class MeterListing(paging.Listing):
    kind: models.Text | None = None
    serial: models.Text | None = None


@meters_router.get("", response_model=paging.Page[schemas.MeterAnswer], responses=answers.problems())
def list_meters(
    request: Request, caller: auth.Reader, context: UsesContext, listing: Annotated[MeterListing, Query()]
) -> Response:
    """The meters of your organisation, oldest first."""
    return paging.page_own(request, context, caller, Meter, listing, schemas.MeterAnswer.of)


@meters_router.get("/{meter_id}", response_model=schemas.MeterAnswer, responses=answers.problems(404))
def get_meter(meter_id: lookup.Id, caller: auth.Reader, context: UsesContext) -> Response:
    """One meter."""
    with context.database.reading() as session:
        return schemas.MeterAnswer.of(lookup.owned(session, Meter, meter_id, caller)).respond()


panels_router = operations.Router(prefix="/v1/panels", tags=["panels"])


@panels_router.post(
    "",
    status_code=201,
    response_model=schemas.PanelAnswer,
    responses={
        200: {
            "model": schemas.PanelAnswer,
            "description": "It was registered already, with the same figures.",
        },
        **answers.problems(409),
    },
)
def create_panel(body: schemas.NewPanel, caller: auth.Calibrator, writing: changes.Writes) -> Response:
    """Register a panel as it was measured on a day. Measured again, it is another entry."""

    def change(session: Session) -> changes.Reply:
        values = body.columns()
        panel, new = find_or_add_panel(session, caller.organisation_id, values)
        if panel.bands != values["bands"]:
            raise Problem(
                interface.PANEL_DIFFERS,
                f"Panel {panel.serial} as measured on {panel.measured_on} is registered with other values: "
                "a measurement does not change. Send the day of the new measurement with the new figures.",
            )
        return changes.Reply(status=201 if new else 200, body=schemas.PanelAnswer.restate(panel))

    return writing.run(caller, change)


class PanelListing(paging.Listing):
    serial: models.Text | None = None


@panels_router.get("", response_model=paging.Page[schemas.PanelAnswer], responses=answers.problems())
def list_panels(
    request: Request, caller: auth.Reader, context: UsesContext, listing: Annotated[PanelListing, Query()]
) -> Response:
    """The panels of your organisation, oldest entry first."""
    return paging.page_own(request, context, caller, Panel, listing, schemas.PanelAnswer.restate)


@panels_router.get("/{panel_id}", response_model=schemas.PanelAnswer, responses=answers.problems(404))
def get_panel(panel_id: lookup.Id, caller: auth.Reader, context: UsesContext) -> Response:
    """One panel as it was measured on a day."""
    with context.database.reading() as session:
        return schemas.PanelAnswer.restate(lookup.owned(session, Panel, panel_id, caller)).respond()
