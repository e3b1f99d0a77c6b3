"""Rigs of cameras, how they are oriented against each other, and the certificate of that."""

import hashlib
import json
from collections.abc import Callable, Sequence
from datetime import datetime
from typing import Annotated, Any, get_args, get_type_hints

from fastapi import Query, Request, Response
from pydantic import BaseModel, Field, model_validator
from sqlalchemy.orm import Session

from radiometry.drawing.text import in_step, write_unit
from radiometry.findings import InputRejected, interface
from radiometry.fitting import evidence
from radiometry.fleet.determinations import LeftOut
from radiometry.fleet.drift import RigStability, RigVersion, compare_sets, group_sets
from radiometry.methods.findings import FINDINGS
from radiometry.specification.exports import RigExport
from service.calibrations.schemas import Gap, VersionLeftOut
from service.documents.certificate import EXPANDED, RELATES, WHOLE, build_certificate
from service.documents.pages import LEGEND, front_matter, list_flag, list_software, list_work, tabulate_points
from service.documents.rendered import Order, order_sheets
from service.documents.routes import send_certificate_json, send_pdf
from service.documents.schemas import FlagInWords, Item, Laboratory, Work
from service.documents.sheets import Node, facts, plain, section, stamp, table
from service.http.answers import problems, sends_file
from service.http.auth import Calibrator, Caller, Reader
from service.http.changes import Reply, Writes
from service.http.context import UsesContext
from service.http.lookup import Id, owned
from service.http.models import (
    EACH_ONCE,
    Answer,
    FindingGroupAnswer,
    Form,
    Instant,
    PositiveText,
    Quantity,
    Text,
    group_flags,
)
from service.http.operations import Router
from service.http.paging import Listing, Page, page_own
from service.http.problems import Problem, invalid
from store.codec import encode
from store.queries.calibration_record import CalibrationRecord, read_calibration_record, state_orientation
from store.queries.fleet import METHOD, SPEC, find_or_add_rig, list_cameras, list_versions, read_member
from store.tables import Calibration, Camera, Rig

_PARTS = get_type_hints(SPEC.result)
MOST_CAMERAS = 20


class NewRig(Form):
    name: Text = Field(description="Under which the rig is found again; its exports carry it.")
    camera_ids: Annotated[
        list[Text],
        Field(
            min_length=2,
            max_length=MOST_CAMERAS,
            description="The reference camera first.",
            json_schema_extra=EACH_ONCE,
        ),
    ]

    @model_validator(mode="after")
    def _each_once(self) -> "NewRig":
        if len(set(self.camera_ids)) < len(self.camera_ids):
            raise ValueError("camera_ids names a camera twice")
        return self


class RigAnswer(Answer, restates=Rig, fields="id name camera_ids created_at"):
    pass


class RelativePoseAnswer(Answer, restates=get_args(_PARTS["poses"])[0]):
    pass


class RigPointAnswer(Answer, restates=get_args(_PARTS["points"])[0]):
    pass


class OrientationAnswer(Answer, restates=SPEC.result):
    pass


class RigSetAnswer(Answer):
    """One set of pictures taken together, with the versions that it was made from."""

    at: Instant
    calibration_ids: list[str]
    orientation: OrientationAnswer
    findings: list[FindingGroupAnswer] = Field(description="Its flags, equal ones as one.")


class RigStabilityAnswer(Answer, restates=RigStability):
    mean: Quantity


class RigOrientationAnswer(Answer):
    rig_id: str
    sets: list[RigSetAnswer] = Field(description="In time, the newest last.")
    stability: list[RigStabilityAnswer]
    left_out: list[VersionLeftOut]


class RigFile(Answer):
    """Cameras and orientation of a rig with their covariances."""

    rig: str
    reference: str
    convention: str
    cameras: list[dict[str, Any]]
    orientations: list[dict[str, Any]]


class CertifiedCamera(Answer):
    """The version of a camera that the orientation takes as it is, with the number of its certificate."""

    item: Item
    certificate: str
    calibration_id: str
    version: int
    content_sha256: str
    state: str


class CertifiedPose(Answer, restates=evidence.Quantity, fields="value standard_uncertainty unit"):
    """A quantity of a camera's orientation with its expanded uncertainty U = k u."""

    camera: str
    name: str
    expanded_uncertainty: float
    coverage_factor: float
    effective_dof: float


class RigCertificateAnswer(Answer):
    """The orientation of a rig from one set, as it is handed out."""

    schema_version: int
    title: str
    number: str
    rig_id: str
    rig: str
    content_sha256: str = Field(description="Of the cameras' versions and the orientation.")
    procedure: str
    equation: str
    laboratory: Laboratory
    work: Work = Field(description="The reference's campaign.")
    cameras: list[CertifiedCamera] = Field(description="The reference first.")
    state: str = Field(description="The worst of the cameras' versions.")
    traceability: str
    at: Instant
    orientation: OrientationAnswer
    coefficients: list[CertifiedPose]
    stability: list[RigStabilityAnswer]
    flags: list[FlagInWords]
    software: dict[str, Any]
    created_at: Instant = Field(description="Of the newest version that it was made from.")
    statements: list[str]
    gaps: list[Gap] = Field(description="What ISO/IEC 17025, 7.8, asks for and a camera's certificate lacks.")


SCHEMA_VERSION = 1
_SUFFICE = (
    "The certificates of the cameras and the triggers of the pictures listed here are sufficient to "
    "recompute every value."
)
_WORST = ("revoked", "draft", "superseded", "published")


def build_rig_certificate(
    rig: Rig,
    records: Sequence[CalibrationRecord],
    at: datetime,
    orientation: Any,  # noqa: ANN401  SPEC.result
    stability: Sequence[Any],
) -> RigCertificateAnswer:
    """Build the whole document from one set, the reference's record first, with the items that it lacks."""
    cameras = [build_certificate(record) for record in records]
    states = [record.status.state for record in records]
    answer = OrientationAnswer.restate(orientation)
    content = {"cameras": [each.content_sha256 for each in cameras], "orientation": answer.dump()}
    sha256 = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
    gaps = {(gap.code, gap.message): gap for each in cameras for gap in each.gaps}
    return RigCertificateAnswer(
        schema_version=SCHEMA_VERSION,
        title="Certificate of orientation",
        number=f"{rig.name}-rig-{sha256[:8]}",
        rig_id=rig.id,
        rig=rig.name,
        content_sha256=sha256,
        procedure=SPEC.certificate.procedure,
        equation=SPEC.certificate.equation,
        laboratory=cameras[0].laboratory,
        work=cameras[0].work,
        cameras=[
            CertifiedCamera.restate(each, certificate=each.number, state=state)
            for each, state in zip(cameras, states, strict=True)
        ],
        state=min(states, key=_WORST.index),
        traceability=SPEC.certificate.traceability,
        at=at,
        orientation=answer,
        coefficients=[CertifiedPose(**each) for each in state_orientation(orientation)],
        stability=[RigStabilityAnswer.restate(each) for each in stability],
        flags=[FlagInWords.restate(each, meaning=FINDINGS[each.flag].sentence) for each in orientation.flags],
        software=cameras[0].software,
        created_at=max(each.created_at for each in cameras),
        statements=[RELATES, EXPANDED, _SUFFICE, WHOLE],
        gaps=list(gaps.values()),
    )


def lay_out_rig(certificate: Node) -> Node:
    orientation = certificate["orientation"]
    return front_matter(certificate, certificate["state"]) | {
        "item": [
            ["Rig", certificate["rig"]],
            ["Reference", orientation["reference"]],
            ["Cameras", str(len(certificate["cameras"]))],
        ],
        "work": list_work(certificate),
        "results": _tabulate(certificate["coefficients"]),
        "summary": [
            f"{certificate['procedure']}. {certificate['equation']}.",
            LEGEND,
            certificate["traceability"],
        ],
        "authority": [
            ["State", f"{certificate['state']}: as the versions of the cameras are"],
            ["Calculated", f"from versions of {stamp(certificate['created_at'])} and before"],
        ],
        "gaps": [gap["message"] for gap in certificate["gaps"]],
        "flags": [list_flag(flag) for flag in certificate["flags"]],
        "sections": [
            section("Cameras", [_cameras(certificate["cameras"])]),
            section("Result", [facts(_scalars(orientation))]),
            section("Repeats and drift", [_stability(certificate["stability"])]),
            section("Pictures", [tabulate_points(SPEC.certificate.columns, orientation["points"])]),
            list_software(certificate, [["rig", certificate["rig_id"]]]),
        ],
        "statements": certificate["statements"],
    }


def _tabulate(rows: list[Node]) -> Node:
    printed = []
    for row in rows:
        value, u = in_step(row["value"], row["standard_uncertainty"])
        expanded = in_step(row["value"], row["expanded_uncertainty"])[1]
        dof = plain(row["effective_dof"], 3) if row["effective_dof"] <= 1000.0 else ""
        k = f"{row['coverage_factor']:.2f}"
        printed.append([row["camera"], row["name"], value, u, expanded, k, dof, write_unit(row["unit"])])
    head = ["camera", "quantity", "value", "u", "U", "k", "dof", "unit"]
    return table(head, printed, align="llrrrrrl", widths=[2.2, 1.4, 1.4, 1, 1, 0.6, 0.6, 0.6])


def _cameras(cameras: list[Node]) -> Node:
    rows = [
        [
            f"{each['item']['make']} {each['item']['model']}",
            each["item"]["serial"],
            each["certificate"],
            each["state"],
            each["content_sha256"],
        ]
        for each in cameras
    ]
    head = ["camera", "serial number", "certificate", "state", "content SHA-256"]
    return table(head, rows, align="llllh", widths=[1.6, 1.8, 2.4, 1, 3])


def _scalars(orientation: Node) -> list[list[str]]:
    found = {name: each for name, each in orientation.items() if isinstance(each, int | float | str)}
    return [
        [name.replace("_", " "), each if isinstance(each, str) else plain(each)]
        for name, each in found.items()
    ]


def _stability(rows: list[Node]) -> Node:
    def state(row: Node, name: str) -> str:
        if name not in row:
            return "-"
        value, u = in_step(row[name]["value"], row[name]["standard_uncertainty"])
        return f"{value} ± {u} {write_unit(row[name]['unit'])}"

    printed = [
        [
            row["camera"],
            row["name"],
            str(row["sets"]),
            *(state(row, name) for name in ("mean", "repeatability", "change")),
            row["verdict"].replace("_", " "),
        ]
        for row in rows
    ]
    head = ["camera", "quantity", "sets", "mean", "repeatability", "change", "verdict"]
    return table(head, printed, align="llrrrrl", widths=[1.6, 0.9, 0.5, 2, 2, 2, 1.1])


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
