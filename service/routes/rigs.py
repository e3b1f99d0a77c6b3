"""Rigs of cameras, and how they are oriented against each other: computed on request, nothing is stored."""

from collections.abc import Callable, Sequence
from typing import Annotated, Any

from fastapi import Query, Request, Response
from pydantic import BaseModel, Field
from sqlalchemy.orm import Session

from radiometry.findings import InputRejected, interface
from radiometry.fleet.determinations import LeftOut
from radiometry.fleet.drift import RigStability, RigVersion, compare_sets, group_sets
from radiometry.specification.exports import RigExport
from service.auth import Calibrator, Caller, Reader
from service.certificate import build_rig_certificate, lay_out_rig
from service.changes import Reply, Writes
from service.context import UsesContext
from service.lookup import Id, owned
from service.operations import Router
from service.paging import Listing, Page, page_own
from service.press.orders import Order, order_sheets
from service.problems import Problem, invalid
from service.routes import problems, sends_file
from service.routes.certificates import send_certificate_json, send_pdf
from service.schemas.base import PositiveText, Text
from service.schemas.findings import group_flags
from service.schemas.rigs import NewRig, RigAnswer, RigCertificateAnswer, RigFile, RigOrientationAnswer
from store.codec import encode
from store.queries.calibration_record import read_calibration_record
from store.queries.fleet import METHOD, SPEC, find_or_add_rig, list_cameras, list_versions, read_member
from store.tables import Calibration, Camera, Rig

router = Router(prefix="/v1/rigs", tags=["rigs"])

MOST_SETS = 20


class _Chosen(BaseModel):
    """Which versions orient a rig."""

    calibration_id: list[str] | None = Field(
        default=None,
        max_length=20,
        description="One version of each camera, in any order, in place of the published ones; repeated.",
    )


class _Judged(_Chosen):
    """Query of a rig's stability, with the change between sets that is accepted."""

    tolerance_deg: PositiveText | None = Field(
        default=None, description="Largest accepted change of an angle over all sets."
    )
    tolerance_m: PositiveText | None = Field(
        default=None, description="Largest accepted change of a place over all sets."
    )

    @property
    def limits(self) -> dict[str, float]:
        limits = {"deg": self.tolerance_deg, "m": self.tolerance_m}
        return {unit: limit for unit, limit in limits.items() if limit is not None}


Versions = Annotated[_Chosen, Query()]
Judging = Annotated[_Judged, Query()]


@router.post(
    "",
    status_code=201,
    response_model=RigAnswer,
    responses={
        200: {"model": RigAnswer, "description": "It was registered already, with the same cameras."},
        **problems(404, 409),
    },
)
def create_rig(body: NewRig, caller: Calibrator, writing: Writes) -> Response:
    """Register cameras that are mounted together, the reference first."""

    def change(session: Session) -> Reply:
        cameras = [owned(session, Camera, camera_id, caller) for camera_id in body.camera_ids]
        serials = [camera.serial for camera in cameras]
        if len(set(serials)) < len(serials):
            message = "two cameras have one serial number, so that an answer could not tell them apart"
            raise invalid([{"type": "rig", "loc": ("body", "camera_ids"), "msg": message}])
        rig, new = find_or_add_rig(
            session, caller.organisation_id, name=body.name, camera_ids=body.camera_ids
        )
        if rig.camera_ids != body.camera_ids:
            raise Problem(
                interface.RIG_DIFFERS,
                f"Rig {rig.name} is registered with other cameras, or in another order: send another name.",
            )
        return Reply(status=201 if new else 200, body=RigAnswer.restate(rig))

    return writing.run(caller, change)


class RigListing(Listing):
    name: Text | None = None


@router.get("", response_model=Page[RigAnswer], responses=problems())
def list_rigs(
    request: Request, caller: Reader, context: UsesContext, listing: Annotated[RigListing, Query()]
) -> Response:
    """The rigs of your organisation, oldest entry first."""
    return page_own(request, context, caller, Rig, listing, RigAnswer.restate)


@router.get("/{rig_id}", response_model=RigAnswer, responses=problems(404))
def get_rig(rig_id: Id, caller: Reader, context: UsesContext) -> Response:
    """One rig."""
    with context.database.reading() as session:
        return RigAnswer.restate(owned(session, Rig, rig_id, caller)).respond()


@router.get("/{rig_id}/orientation", response_model=RigOrientationAnswer, responses=problems(404))
def get_rig_orientation(
    rig_id: Id,
    caller: Reader,
    context: UsesContext,
    judging: Judging,
) -> Response:
    """The orientation of a rig's cameras from board pictures taken together, by set, and its stability."""
    _, found, why = _orient_sets(rig_id, caller, context, judging.calibration_id)
    return RigOrientationAnswer.restate(
        rig_id=rig_id,
        sets=[
            {
                "at": members[0].at,
                "calibration_ids": [each.version for each in members],
                "orientation": orientation,
                "findings": group_flags(encode(raised) for raised in orientation.flags),
            }
            for members, orientation in found
        ],
        stability=_compare(found, judging),
        left_out=why,
    ).respond()


@router.get("/{rig_id}/certificate.json", response_model=RigCertificateAnswer, responses=problems(404))
def get_rig_certificate(
    rig_id: Id,
    request: Request,
    caller: Reader,
    context: UsesContext,
    judging: Judging,
) -> Response:
    """The orientation of the newest set, with what a laboratory hands out with it.

    It rests on the versions of the cameras, whose certificates it names; its state is the worst of theirs.
    """
    return send_certificate_json(request, _certify(rig_id, caller, context, judging))


@router.get("/{rig_id}/certificate.pdf", response_class=Response, responses=sends_file("application/pdf"))
async def get_rig_certificate_pdf(
    rig_id: Id,
    request: Request,
    caller: Reader,
    context: UsesContext,
    judging: Judging,
) -> Response:
    """The certificate of a rig on paper (PDF/A-3), with its certificate.json attached."""

    def order() -> tuple[str, Order]:
        certificate = _certify(rig_id, caller, context, judging)
        return certificate["number"], order_sheets(lay_out_rig(certificate))

    return await send_pdf(request, context, order)


def _certify(rig_id: str, caller: Caller, context: UsesContext, judging: _Judged) -> dict[str, Any]:
    rig, found, _ = _orient_sets(rig_id, caller, context, judging.calibration_id)
    members, orientation = _newest(found)
    with context.database.reading() as session:
        versions = [owned(session, Calibration, each.version, caller) for each in members]
        records = [
            read_calibration_record(session, each, context.reviews.find(session, each.campaign_id).record)
            for each in versions
        ]
        answer = build_rig_certificate(rig, records, members[0].at, orientation, _compare(found, judging))
    return answer.dump()


_Oriented = Sequence[tuple[tuple[RigVersion, ...], Any]]


def _newest(found: _Oriented) -> tuple[tuple[RigVersion, ...], Any]:
    if not found:
        raise Problem(interface.NOT_FOUND, "No set of published versions orients this rig yet.")
    return found[-1]


def _compare(found: _Oriented, judging: _Judged) -> tuple[RigStability, ...]:
    return compare_sets(
        [(members[0].at, SPEC.list_quantities(orientation)) for members, orientation in found],
        limits=judging.limits,
    )


def _orient_sets(
    rig_id: str, caller: Caller, context: UsesContext, calibration_ids: list[str] | None
) -> tuple[Rig, _Oriented, list[LeftOut]]:
    """Return the rig, its newest sets with their orientations, and the versions that are in none."""
    rig, sets, left_out = _find_sets(rig_id, caller, context, calibration_ids)
    found, why = [], list(left_out)
    for members in sets[-MOST_SETS:]:
        try:
            found.append((members, SPEC.orient([each.member for each in members])))
        except InputRejected as refusal:
            if len(sets) == 1:
                raise
            why += [LeftOut(version=each.version, why=refusal.message) for each in members]
    return rig, found, why


def _find_sets(
    rig_id: str, caller: Caller, context: UsesContext, calibration_ids: list[str] | None
) -> tuple[Rig, tuple[tuple[RigVersion, ...], ...], tuple[LeftOut, ...]]:
    with context.database.reading() as session:
        rig = owned(session, Rig, rig_id, caller)
        cameras = list_cameras(session, rig)
        if calibration_ids:
            rows = [owned(session, Calibration, each, caller) for each in calibration_ids]
            by_camera = {row.camera_id: row for row in rows if row.method == METHOD}
            if len(rows) != len(cameras) or by_camera.keys() != set(rig.camera_ids):
                message = f"must name one {METHOD} version of each of the rig's {len(cameras)} cameras"
                raise invalid([{"type": "rig", "loc": ("query", "calibration_id"), "msg": message}])
            members = tuple(
                RigVersion(
                    version=by_camera[camera.id].id,
                    at=by_camera[camera.id].created_at,
                    member=read_member(session, by_camera[camera.id], camera),
                )
                for camera in cameras
            )
            return rig, (members,), ()
        versions, left_out = zip(*(list_versions(session, camera) for camera in cameras), strict=True)
    sets, others = group_sets(versions, SPEC.count_shared)
    return rig, sets, (*(each for group in left_out for each in group), *others)


def _add_export(export: RigExport) -> None:
    def send(rig_id: Id, caller: Reader, context: UsesContext, chosen: Versions) -> Response:
        rig, found, _ = _orient_sets(rig_id, caller, context, chosen.calibration_id)
        members, orientation = _newest(found)
        written = export.write(orientation, [each.member for each in members], rig.name)
        return Response(written, media_type=export.media_type)

    send.__name__, send.__doc__ = export.operation, export.description
    answer = {"get_rig_json": RigFile}.get(export.operation)
    stated: dict[str, Any] = (
        {"response_model": answer, "responses": problems(404)}
        if answer
        else {"response_class": Response, "responses": sends_file(export.media_type)}
    )
    add: Callable[..., Any] = router.get(f"/{{rig_id}}/exports/{export.filename}", **stated)
    add(send)


for _export in SPEC.exports:
    _add_export(_export)
