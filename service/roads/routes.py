"""Roads: stated, read at control points, evaluated and planned."""

import hashlib
from typing import Annotated, Final

import numpy as np
from fastapi import Depends, Path, Query, Request, Response
from pydantic import Field, TypeAdapter, ValidationError
from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.findings import interface
from radiometry.road import geojson, grid, rules, site
from radiometry.road.plan import plan_points
from service.frames.routes import require_header
from service.http import answers, auth, changes, lookup, models, operations, tables
from service.http.context import Context, UsesContext
from service.http.paging import Page, UsesPaging
from service.http.problems import Problem, invalid, located, wrong
from service.jobs.routes import QUEUES, enqueue, reply_queued
from service.measurements.exports import GeoJson
from service.roads import schemas, words
from service.tools.routes import stateless
from store.codec import decode, drop_absent, encode
from store.measuring.roads import plan_evaluation, plan_placement, read_placement
from store.publications import list_issued
from store.queries.calibrations import read_version_statuses
from store.queries.frame_times import FrameClocks
from store.tables import Calibration, Camera, FrameRow, Meter, Road, RoadResult

Number = Annotated[int, Path(ge=1, le=1_000_000)]
_VALUES: Final = ("value", *(f"value_{number}" for number in range(2, 10)))
_KIND: Final = tables.Kind(
    numbers=frozenset({"x_m", "y_m", "u_rel", *_VALUES}),
    most=schemas.MOST_POINTS,
    rows_are="points",
    usual={"quantity": "illuminance", "unit": "lx"},
    lists={"values": _VALUES},
    known=[*_VALUES, *(name for name in schemas.RoadPoint.model_fields if name != "values")],
    needed=("name", "x_m", "y_m", "value"),
)
_MANY: Final = TypeAdapter(Annotated[list[schemas.RoadPoint], Field(max_length=schemas.MOST_POINTS)])
_POINT: Final = {"name": "P1", "x_m": 1.5, "y_m": 1.8, "quantity": "illuminance", "unit": "lx"}
_ITEMS: Final = {"items": schemas.RoadPoint.model_json_schema(), "maxItems": schemas.MOST_POINTS}
_BODY: Final = tables.state_body({"type": "array"} | _ITEMS, example=[_POINT | {"values": [49.1]}])

router = operations.Router(prefix="/v1/roads", tags=["roads"])
rules_router = operations.Router(prefix="/v1", tags=["roads"])


def find_result(road_id: lookup.Id, number: Number, caller: auth.Reader, context: UsesContext) -> RoadResult:
    """Return an evaluation of a road of the caller's."""
    with context.database.reading() as session:
        row = lookup.owned(session, Road, road_id, caller)
        found = session.scalar(select(RoadResult).filter_by(road_id=row.id, number=number))
    if found is None:
        raise Problem(interface.NOT_FOUND, f"This road has no evaluation {number}.")
    return found


UsesResult = Annotated[RoadResult, Depends(find_result)]


@rules_router.get("/road-rules", response_model=schemas.RoadRules)
def list_road_rules(_: auth.Reader) -> Response:
    """Classes and grids of the standards, with their source, their date and how they were read.

    Confirm a rule's figures against its text, or send your own as `criteria` of the requirement.
    """
    return schemas.RoadRules.restate(items=rules.list_rules()).respond()


@router.post("", status_code=201, response_model=schemas.RoadAnswer, responses=answers.problems(404))
def create_road(body: schemas.NewRoad, caller: auth.Calibrator, session: Session) -> changes.Reply:
    """Register a road on one night: its site, what is required of it, and the frames that show it."""
    row = Road(organisation_id=caller.organisation_id, created_by=caller.key_id, conditions={}, frames=[])
    return changes.Reply(status=201, body=_write(session, row, body, caller))


@router.get("", response_model=Page[schemas.RoadAnswer])
def list_roads(paging: UsesPaging, caller: auth.Reader, session: Session) -> Response:
    """The roads of your organisation, newest first."""
    return paging.send_own(
        session, caller, select(Road), lambda row: answer_road(session, row), newest_first=True
    )


@router.get("/{road_id}", response_model=schemas.RoadAnswer)
def get_road(road: lookup.Own[Road], session: Session) -> Response:
    """One road as it is stated, with its grid, its control points and its evaluations."""
    return answer_road(session, road).respond()


@router.patch("/{road_id}", response_model=schemas.RoadAnswer)
def change_road(
    road: lookup.Locked[Road], body: schemas.RoadChange, caller: auth.Calibrator, session: Session
) -> changes.Reply:
    """Correct a road. Evaluations that exist stay as they are."""
    return changes.Reply(status=200, body=_write(session, road, body, caller))


@router.get("/{road_id}/site.geojson", **answers.sends_file(GeoJson.media_type))
def get_road_site(road: lookup.Own[Road], request: Request) -> Response:
    """The site as GeoJSON: in degrees of WGS 84 if it has an origin, else in metres of the road."""
    answer = GeoJson(drop_absent(geojson.write_site(decode(site.Site, road.site))))
    answer.headers.update(answers.standing(request, hashlib.sha256(answer.body).hexdigest()))
    return answer


def _read_site(body: schemas.SiteFeatures) -> schemas.RoadChange:
    """Read the site before the road is locked."""
    read = drop_absent(encode(geojson.read_site(body.model_dump())))
    try:
        return schemas.RoadChange.model_validate({"site": read})
    except ValidationError as error:
        raise invalid(located(error, "body")) from None


@router.put("/{road_id}/site.geojson", response_model=schemas.RoadAnswer)
def put_road_site(
    road: lookup.Locked[Road],
    stated: Annotated[schemas.RoadChange, Depends(_read_site)],
    caller: auth.Calibrator,
    session: Session,
) -> changes.Reply:
    """State the site as GeoJSON, as its GET writes it: x = 0, y = 0 is then the first luminaire."""
    return changes.Reply(status=200, body=_write(session, road, stated, caller))


async def _read_points(request: Request) -> list[schemas.RoadPoint]:
    """Read JSON or CSV, by the content type; each bad field or row is named."""
    return await tables.read_sheet_or_document(
        request, lambda data: tables.read_sheet(data, schemas.RoadPoint, _KIND), _MANY.validate_python
    )


@router.put("/{road_id}/points", response_model=schemas.RoadPoints, openapi_extra=_BODY)
def put_road_points(
    road: lookup.Locked[Road],
    body: Annotated[list[schemas.RoadPoint], Depends(_read_points)],
    caller: auth.Calibrator,
    session: Session,
) -> changes.Reply:
    """State all control points of a road, as JSON or as a table with a line each.

    A table has `value`, and `value_2` to `value_9` for repeats, in lx without `quantity` and `unit`.
    """
    if len({point.name for point in body}) < len(body):
        raise wrong("body", "names a point twice; repeated readings are further values of one point")
    lookup.require_meters(session, [(point.meter_id, point.quantity) for point in body], caller)
    road.points = [point.model_dump(mode="json", exclude_none=True) for point in body]
    return changes.Reply(status=200, body=schemas.RoadPoints.model_validate({"items": road.points}))


@router.get("/{road_id}/points", response_model=schemas.RoadPoints)
def get_road_points(road: lookup.Own[Road]) -> Response:
    """The control points of a road, as they were entered."""
    return schemas.RoadPoints.model_validate({"items": road.points}).respond()


@router.post("/{road_id}/placement", response_model=schemas.PlacementAnswer, dependencies=stateless)
def place_road_frame(
    road: lookup.Own[Road], body: schemas.RoadFrame, caller: auth.Reader, context: UsesContext
) -> Response:
    """Preview the place of a frame by these marks, or by its own position, without stating them."""
    stated = body.model_dump(mode="json", exclude_none=True)
    with context.database.reading() as session:
        frame = lookup.owned(session, FrameRow, body.frame_id, caller)
        header, over = require_header(frame), decode(site.Site, road.site)
        named = plan_placement(session, FrameClocks(session), frame, stated, over)
        geometry = session.get_one(Calibration, named["geometry_id"]) if "geometry_id" in named else None
    size = {"height_px": header["height_px"], "width_px": header["width_px"]}
    placed = read_placement(named, geometry, over, **size)
    points = np.array([(each.x_m, each.y_m) for each in _lay_grid(road)])
    return schemas.PlacementAnswer(
        h=placed.h.tolist(),
        matrix=placed.camera.matrix.tolist(),
        distortion=placed.camera.distortion.tolist(),
        place_u_m=float(placed.estimate_u_m(points).max()),
    ).respond()


@router.post("/{road_id}/evaluate", **QUEUES, responses=answers.problems(404, 409))
def evaluate_road(road: lookup.Own[Road], caller: auth.Uploader, session: Session) -> changes.Reply:
    """Evaluate a road as it is stated now. The job's result names the evaluation.

    Each frame is measured with the version in force when it was taken, and placed by its marks.
    """
    if not road.frames:
        raise wrong("road", "has no frames: state them with their marks first")
    plan = plan_evaluation(session, road, _state_road(session, road))
    return reply_queued(session, enqueue(session, caller, "measure", road.id, plan))


@router.get("/{road_id}/results/{number}", **answers.sends(schemas.RoadResultAnswer))
def get_road_result(row: UsesResult, request: Request, context: UsesContext) -> Response:
    """One evaluation: figures with their intervals, verdicts, points, control points and flags."""
    answer: models.Answer = answer_result(context, row)
    # the state and the certificate of a version may have changed since
    tag = hashlib.sha256(answer.model_dump_json().encode()).hexdigest()
    return answer.respond(answers.standing(request, tag))


@router.get("/{road_id}/results/{number}/points.csv", **answers.sends_file("text/csv"))
def get_road_points_csv(row: UsesResult, request: Request) -> Response:
    """The points of the grid, a line each: place, illuminance and its relative standard uncertainty."""
    headers = answers.immutable(request, f"{row.content_sha256}-csv")
    return Response(tables.write_csv(row.result["points"]), 200, headers, "text/csv; charset=utf-8")


@router.get("/{road_id}/results/{number}/points.geojson", **answers.sends_file(GeoJson.media_type))
def get_road_points_geojson(row: UsesResult, request: Request) -> Response:
    """Grid points and control points as GeoJSON: in degrees if the site has an origin, else in metres."""
    stated, points = decode(site.Site, row.inputs["road"]["site"]), row.result["points"]
    headers = answers.immutable(request, f"{row.content_sha256}-geojson")
    return GeoJson(drop_absent(geojson.write_points(stated, [*points, *row.result["control"]])), 200, headers)


@router.get("/{road_id}/results/{number}/map.png", **answers.sends_stored_file("image/png"))
def get_road_map(row: UsesResult, request: Request, context: UsesContext) -> Response:
    """The road from above in false colours of illuminance; `map` of the evaluation names what it shows."""
    if row.map_png_sha256 is None:
        raise Problem(interface.NOT_FOUND, "This evaluation has no map.")
    return answers.send_blob(request, context.files, row.map_png_sha256, "image/png", {})


@router.get("/{road_id}/plan", response_model=schemas.RoadPlanAnswer)
def plan_road(
    road: lookup.Own[Road], wanted: Annotated[schemas.WantedPlan, Query()], context: UsesContext
) -> Response:
    """Plan the control points and exposure times that are expected to reach these uncertainties."""
    return answer_plan(context, road, wanted).respond()


def answer_plan(context: Context, road: Road, wanted: schemas.WantedPlan) -> models.Answer:
    with context.database.reading() as session:
        stated = _state_road(session, road)
    answer: models.Answer = schemas.RoadPlanAnswer.restate(plan_points(stated, **wanted.model_dump()))
    return answer


def answer_road(session: Session, row: Road) -> schemas.RoadAnswer:
    made = session.execute(
        select(RoadResult.number, RoadResult.created_at, RoadResult.result["verdict"].as_string())
        .where(RoadResult.road_id == row.id)
        .order_by(RoadResult.number)
    )
    return schemas.RoadAnswer.restate(
        row,
        grid=list(_lay_grid(row)),
        results=[
            {"number": n, "created_at": at, "verdict": said, "link": f"/v1/roads/{row.id}/results/{n}"}
            for n, at, said in made
        ],
    )


def answer_result(context: Context, row: RoadResult) -> schemas.RoadResultAnswer:
    own = f"/v1/roads/{row.road_id}/results/{row.number}"
    told = drop_absent(row.result | {"stated": row.inputs["road"]})
    with context.database.reading() as session:
        name, frames = session.get_one(Road, row.road_id).name, _list_frames(session, row)
    answer: schemas.RoadResultAnswer = schemas.RoadResultAnswer.restate(
        told,
        row,
        said=[words.tell_verdict(told), words.tell_why(told)],
        name=name,
        findings=models.group_flags(row.result["flags"]),
        frames=frames,
        links={each: f"{own}/{each}" for each in ("points.csv", "points.geojson", "report.pdf", "map.png")},
    )
    return answer


def _list_frames(session: Session, row: RoadResult) -> list[schemas.EvaluatedFrame]:
    used = row.inputs["frames"]
    status = read_version_statuses(session, sorted({each["calibration_id"] for each in used}))
    found = []
    for each in used:
        frame = session.get_one(FrameRow, each["frame_id"])
        version = session.get_one(Calibration, each["calibration_id"])
        camera = session.get_one(Camera, version.camera_id)
        issued = list_issued(session, version.id)
        found.append(
            schemas.EvaluatedFrame.restate(
                each,
                frame.header or {},
                frame.exposure or {},
                frame,
                calibration_version=version.version,
                certificate=issued[-1].number if issued else None,
                calibration_state=status[version.id].state,
                camera=f"{camera.make} {camera.model} {camera.serial}",
                lens=each.get("geometry_id", "none"),
                placed_by="marks" if "marks" in each else "position",
            )
        )
    return found


def _write(session: Session, row: Road, body: schemas.RoadChange, caller: auth.Caller) -> schemas.RoadAnswer:
    """Write what was sent, and refuse a site or requirement that cannot be used."""
    sent = body.model_dump(mode="json", exclude_none=True)
    for frame in sent.get("frames", ()):
        lookup.owned(session, FrameRow, frame["frame_id"], caller)
    for name, value in sent.items():
        setattr(row, name, value)
    rules.find_criteria(decode(site.Requirement, row.requirement))
    if unknown := set(row.hidden or ()) - {each.name for each in _lay_grid(row)}:
        raise wrong("body.hidden", f"names {min(unknown)!r}, which is no point of the grid")
    session.add(row)
    session.flush()
    return answer_road(session, row)


def _lay_grid(row: Road) -> tuple[grid.GridPoint, ...]:
    return grid.lay_points(decode(site.Site, row.site), rules.find_rule(row.requirement["rule"]).grid)


def _state_road(session: Session, row: Road) -> site.Road:
    """Return the road with its control points, and the meters behind them."""
    named = dict.fromkeys(each["meter_id"] for each in row.points if "meter_id" in each)
    return site.Road(
        site=decode(site.Site, row.site),
        requirement=decode(site.Requirement, row.requirement),
        conditions=decode(site.Conditions, row.conditions),
        control=decode(tuple[site.ControlPoint, ...], row.points),
        meters=tuple(_state_meter(session.get_one(Meter, each)) for each in named),
        hidden=tuple(row.hidden),
    )


def _state_meter(row: Meter) -> site.Meter:
    u, k = row.certificate_expanded_uncertainty_rel, row.certificate_coverage_factor
    return site.Meter(
        meter_id=row.id,
        meter=f"{row.make} {row.model} {row.serial}",
        u_rel=u / k if u and k else None,
        certificate=row.certificate_number,
    )
