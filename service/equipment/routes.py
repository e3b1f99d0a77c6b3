"""Cameras, meters, panels and rigs."""

import hashlib
from collections.abc import Sequence
from typing import Annotated, Any, get_args, get_type_hints

from fastapi import Depends, Query, Request, Response
from pydantic import BaseModel
from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.findings import InputRejected, interface
from radiometry.fleet import determinations, drift
from radiometry.specification.exports import RigExport
from service.calibrations.schemas import VersionLeftOut
from service.equipment import schemas
from service.http import answers, changes, lookup, models, operations, paging, problems
from service.http.auth import Calibrator, Caller, Reader
from service.http.context import UsesContext
from service.http.models import Answer, Name, Text, maybe, told
from store.codec import drop_absent, encode
from store.queries import fleet, organisations
from store.queries.campaigns import check_again
from store.tables import Calibration, Camera, Campaign, Meter, Panel, Rig

router = operations.Router(prefix="/v1/cameras", tags=["cameras"])


@router.post("", **answers.makes(schemas.CameraAnswer, "It was registered already."))
def create_camera(body: schemas.NewCamera, caller: Calibrator, session: Session) -> changes.Reply:
    """Register a camera body, with the names that it writes into its files."""
    values = schemas.lay_flat(body, "lens")
    camera, new = organisations.find_or_add_camera(session, caller.organisation_id, values)
    return changes.Reply(status=201 if new else 200, body=schemas.CameraAnswer.of(camera))


class CameraListing(paging.Paging):
    make: Name | None = None
    model: Name | None = None
    serial: Name | None = None


@router.get("", response_model=paging.Page[schemas.CameraAnswer])
def list_cameras(listing: Annotated[CameraListing, Depends()], caller: Reader, session: Session) -> Response:
    """The cameras of your organisation, oldest first."""
    return listing.send_own(session, caller, select(Camera), schemas.CameraAnswer.of)


@router.get("/{camera_id}", response_model=schemas.CameraAnswer)
def get_camera(camera: lookup.Own[Camera]) -> Response:
    """One camera."""
    return schemas.CameraAnswer.of(camera).respond()


@router.patch("/{camera_id}", response_model=schemas.CameraAnswer)
def change_camera(
    camera: lookup.Own[Camera], body: schemas.CameraChange, caller: Calibrator, session: Session
) -> changes.Reply:
    """Correct a camera's names, lens or sensor. With other names its campaigns' frames are checked again."""
    before = _names(camera)
    for name, value in schemas.lay_flat(body, "lens").items():
        setattr(camera, name, None if value == "" else value)
    jobs = []
    if _names(camera) != before:
        with session.no_autoflush:
            alike = organisations.find_alike(session, Camera, caller.organisation_id, _names(camera))
        if alike not in {None, camera}:
            raise problems.wrong("body.serial", "is that of another camera of yours: move the campaign to it")
        mine = select(Campaign).where(Campaign.camera_id == camera.id, Campaign.archived_at.is_(None))
        campaigns = session.scalars(mine.order_by(Campaign.id)).all()
        jobs = [job for each in campaigns for job in check_again(session, each, by=caller.key_id)]
    return changes.Reply(status=200, body=schemas.CameraAnswer.of(camera), jobs=jobs)


def _names(camera: Camera) -> dict[str, str]:
    return {"make": camera.make, "model": camera.model, "serial": camera.serial}


meters_router = operations.Router(prefix="/v1/meters", tags=["meters"])


@meters_router.post(
    "",
    **answers.makes(schemas.MeterAnswer, "It was registered already; a certificate sent now is its newest."),
)
def create_meter(body: schemas.NewMeter, caller: Calibrator, session: Session) -> changes.Reply:
    """Register a meter, with its calibration certificate where there is one."""
    values = schemas.lay_flat(body, "certificate")
    meter, new = organisations.find_or_add_meter(session, caller.organisation_id, values)
    return changes.Reply(status=201 if new else 200, body=schemas.MeterAnswer.of(meter))


class MeterListing(paging.Paging):
    kind: Text | None = None
    serial: Name | None = None


@meters_router.get("", response_model=paging.Page[schemas.MeterAnswer])
def list_meters(listing: Annotated[MeterListing, Depends()], caller: Reader, session: Session) -> Response:
    """The meters of your organisation, oldest first."""
    return listing.send_own(session, caller, select(Meter), schemas.MeterAnswer.of)


@meters_router.get("/{meter_id}", response_model=schemas.MeterAnswer)
def get_meter(meter: lookup.Own[Meter]) -> Response:
    """One meter."""
    return schemas.MeterAnswer.of(meter).respond()


panels_router = operations.Router(prefix="/v1/panels", tags=["panels"])


@panels_router.post(
    "", **answers.makes(schemas.PanelAnswer, "It was registered; figures that no fit used are replaced.", 409)
)
def create_panel(body: schemas.NewPanel, caller: Calibrator, session: Session) -> changes.Reply:
    """Register a panel as it was measured on a day. Measured again, it is another entry."""
    values = body.columns()
    panel, new = organisations.find_or_add_panel(session, caller.organisation_id, values)
    if panel.bands != values["bands"]:
        raise problems.Problem(
            interface.PANEL_DIFFERS,
            f"A version used other figures of panel {panel.serial} as measured on {panel.measured_on}. "
            "Send the day of the new measurement with the new figures.",
        )
    return changes.Reply(status=201 if new else 200, body=schemas.PanelAnswer.restate(panel))


class PanelListing(paging.Paging):
    serial: Name | None = None


@panels_router.get("", response_model=paging.Page[schemas.PanelAnswer])
def list_panels(listing: Annotated[PanelListing, Depends()], caller: Reader, session: Session) -> Response:
    """The panels of your organisation, oldest entry first."""
    return listing.send_own(session, caller, select(Panel), schemas.PanelAnswer.restate)


@panels_router.get("/{panel_id}", response_model=schemas.PanelAnswer)
def get_panel(panel: lookup.Own[Panel]) -> Response:
    """One panel as it was measured on a day."""
    return schemas.PanelAnswer.restate(panel).respond()


_PARTS = get_type_hints(fleet.SPEC.result)
MOST_CAMERAS = 20


class NewRig(models.Form):
    name: Text = told("Under which the rig is found again; its exports carry it.")
    camera_ids: models.CameraIds = told("The reference camera first.", max_length=MOST_CAMERAS)


class RigAnswer(Answer, restates=Rig, fields="id name camera_ids created_at"):
    pass


class RelativePoseAnswer(Answer, restates=get_args(_PARTS["poses"])[0]):
    pass


class RigPointAnswer(Answer, restates=get_args(_PARTS["points"])[0]):
    pass


class OrientationAnswer(Answer, restates=fleet.SPEC.result):
    pass


class RigSetAnswer(Answer):
    """One set of pictures taken together, with the versions that it was made from."""

    at: models.Instant
    calibration_ids: list[str]
    orientation: OrientationAnswer
    findings: list[models.FindingGroupAnswer] = told("Its flags, equal ones as one.")


class RigStabilityAnswer(Answer, restates=drift.RigStability):
    mean: models.Quantity


class RigOrientationAnswer(Answer):
    rig_id: str
    sets: list[RigSetAnswer] = told("In time, the newest last.")
    stability: list[RigStabilityAnswer]
    left_out: list[VersionLeftOut]


class RigFile(Answer):
    """Cameras and orientation of a rig with their covariances."""

    rig: str
    reference: str
    convention: str
    cameras: list[dict[str, Any]]
    orientations: list[dict[str, Any]]


rigs_router = operations.Router(prefix="/v1/rigs", tags=["rigs"])

MOST_SETS = 20


class _Chosen(BaseModel):
    """Which versions orient a rig."""

    calibration_id: list[str] | None = maybe(
        "One version of each camera, in any order, in place of the published ones; repeated.", max_length=20
    )


class _Judged(_Chosen):
    """Query of a rig's stability, with the change between sets that is accepted."""

    tolerance_deg: models.PositiveText | None = maybe("Largest accepted change of an angle over all sets.")
    tolerance_m: models.PositiveText | None = maybe("Largest accepted change of a place over all sets.")


Versions = Annotated[_Chosen, Query()]
Judging = Annotated[_Judged, Query()]


@rigs_router.post(
    "", **answers.makes(RigAnswer, "It was registered already, with the same cameras.", 404, 409)
)
def create_rig(body: NewRig, caller: Calibrator, session: Session) -> changes.Reply:
    """Register cameras that are mounted together, the reference first."""
    cameras = [lookup.owned(session, Camera, camera_id, caller) for camera_id in body.camera_ids]
    serials = [camera.serial for camera in cameras]
    if len(set(serials)) < len(serials):
        message = "two cameras have one serial number, so that an answer could not tell them apart"
        raise problems.wrong("body.camera_ids", message)
    rig, new = organisations.find_or_add(
        session, Rig, caller.organisation_id, body.model_dump(), by=("name",)
    )
    if rig.camera_ids != body.camera_ids:
        raise problems.Problem(
            interface.RIG_DIFFERS,
            f"Rig {rig.name} is registered with other cameras, or in another order: send another name.",
        )
    return changes.Reply(status=201 if new else 200, body=RigAnswer.restate(rig))


class RigListing(paging.Paging):
    name: Text | None = None


@rigs_router.get("", response_model=paging.Page[RigAnswer])
def list_rigs(listing: Annotated[RigListing, Depends()], caller: Reader, session: Session) -> Response:
    """The rigs of your organisation, oldest entry first."""
    return listing.send_own(session, caller, select(Rig), RigAnswer.restate)


@rigs_router.get("/{rig_id}", response_model=RigAnswer)
def get_rig(rig: lookup.Own[Rig]) -> Response:
    """One rig."""
    return RigAnswer.restate(rig).respond()


@rigs_router.get("/{rig_id}/orientation", response_model=RigOrientationAnswer)
def get_rig_orientation(
    rig: lookup.Own[Rig], caller: Reader, context: UsesContext, judging: Judging
) -> Response:
    """The orientation of a rig's cameras from board pictures taken together, by set, and its stability."""
    found, why = _orient_sets(rig, caller, context, judging.calibration_id)
    return RigOrientationAnswer.restate(
        rig_id=rig.id,
        sets=[
            {
                "at": members[0].at,
                "calibration_ids": [each.version for each in members],
                "orientation": orientation,
                "findings": models.group_flags(encode(raised) for raised in orientation.flags),
            }
            for members, orientation in found
        ],
        stability=drift.compare_sets(
            [(members[0].at, fleet.SPEC.list_quantities(orientation)) for members, orientation in found],
            limits=drop_absent({"deg": judging.tolerance_deg, "m": judging.tolerance_m}),
        ),
        left_out=why,
    ).respond()


_Oriented = Sequence[tuple[tuple[drift.RigVersion, ...], Any]]


def _orient_sets(
    rig: Rig, caller: Caller, context: UsesContext, calibration_ids: list[str] | None
) -> tuple[_Oriented, list[determinations.LeftOut]]:
    sets, left_out = _find_sets(rig, caller, context, calibration_ids)
    found, why = [], list(left_out)
    for members in sets[-MOST_SETS:]:
        try:
            found.append((members, fleet.SPEC.orient([each.member for each in members])))
        except InputRejected as refusal:
            if len(sets) == 1:
                raise
            why += [determinations.LeftOut(version=each.version, why=refusal.message) for each in members]
    return found, why


def _find_sets(
    rig: Rig, caller: Caller, context: UsesContext, calibration_ids: list[str] | None
) -> tuple[tuple[tuple[drift.RigVersion, ...], ...], tuple[determinations.LeftOut, ...]]:
    with context.database.reading() as session:
        cameras = fleet.list_cameras(session, rig)
        if calibration_ids:
            rows = [lookup.owned(session, Calibration, each, caller) for each in calibration_ids]
            by_camera = {row.camera_id: row for row in rows if row.method == fleet.METHOD}
            if len(rows) != len(cameras) or by_camera.keys() != set(rig.camera_ids):
                message = f"must name one {fleet.METHOD} version of each of the rig's {len(cameras)} cameras"
                raise problems.wrong("query.calibration_id", message)
            members = tuple(
                drift.RigVersion(
                    version=by_camera[camera.id].id,
                    at=by_camera[camera.id].created_at,
                    member=fleet.read_member(session, by_camera[camera.id], camera),
                )
                for camera in cameras
            )
            return (members,), ()
        versions, left_out = zip(*(fleet.list_versions(session, camera) for camera in cameras), strict=True)
    sets, others = drift.group_sets(versions, fleet.SPEC.count_shared)
    return sets, (*(each for group in left_out for each in group), *others)


def _add_export(export: RigExport) -> None:
    def send(
        rig: lookup.Own[Rig], caller: Reader, context: UsesContext, chosen: Versions, request: Request
    ) -> Response:
        found, _ = _orient_sets(rig, caller, context, chosen.calibration_id)
        if not found:
            raise problems.Problem(interface.NOT_FOUND, "No set of published versions orients this rig yet.")
        members, orientation = found[-1]
        written = export.write(orientation, [each.member for each in members], rig.name)
        headers = answers.standing(request, hashlib.sha256(written.encode()).hexdigest())
        return Response(written, headers=headers, media_type=export.media_type)

    stated = answers.sends_file(export.media_type)
    if export.operation == "get_rig_json":
        stated = answers.sends(RigFile, 404)
    stated |= {"name": export.operation, "description": export.description}
    rigs_router.add_api_route(f"/{{rig_id}}/exports/{export.filename}", send, **stated)


for _export in fleet.SPEC.exports:
    _add_export(_export)
