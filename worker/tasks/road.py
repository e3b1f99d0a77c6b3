"""A road evaluated: the luminances of its points in every frame, and the verdict."""

from contextlib import contextmanager
from typing import Any

from sqlalchemy.orm import Session

from radiometry.findings import InputRejected, files
from radiometry.road import codes
from radiometry.road.evaluation import evaluate_road
from radiometry.road.grid import lay_points
from radiometry.road.observations import lay_cells
from radiometry.road.rules import find_rule
from radiometry.road.site import Road as StatedRoad
from store import jobs
from store.codec import decode, encode
from store.measuring.roads import write_result
from store.tables import Calibration, FrameRow, Json, Road
from worker.context import Context, Outcome
from worker.decode.pool import DecoderCrashed
from worker.measuring.road import RoadReader, Seen, choose_scale, draw_road
from worker.measuring.task import Task


def evaluate(context: Context, claim: jobs.Claim) -> Outcome:
    """Read every frame that the plan names, and evaluate the road."""
    plan = claim.parameters
    stated = decode(StatedRoad, plan["road"])
    points = lay_points(stated.site, find_rule(stated.requirement.rule).grid)
    conditions = {
        name: plan["road"]["conditions"][column]
        for name, column in (("lamp_kind", "lamp_kind"), ("mains_frequency_hz", "mains_frequency_hz"))
        if plan["road"]["conditions"].get(column) is not None
    }
    reader = RoadReader(stated.site, lay_cells(stated, points), conditions)
    seen = []
    for number, each in enumerate(plan["frames"], start=1):
        seen.append(_read_frame(context, reader, each))
        context.leases.report(claim, 0.9 * number / len(plan["frames"]))
    if not reader.scales:
        raise codes.ROAD_NOT_SEEN.refuse("No frame shows a point of the road.")
    readings = [reading for one in seen for reading in one.readings]
    result = evaluate_road(stated, points, readings, scale=choose_scale(reader.scales))
    png, shown = draw_road(reader.view, [one.above_cd_m2 for one in seen], result)
    picture = context.blobs.keep([png])

    def store(session: Session) -> dict[str, Any]:
        row = session.get_one(Road, claim.subject_id)
        kept = encode(result) | {"map": shown}
        made = write_result(session, row, plan, kept, picture, by=claim.created_by)
        return {
            "result_id": made.id,
            "number": made.number,
            "result": f"/v1/roads/{row.id}/results/{made.number}",
        }

    return Outcome(store=store)


def _read_frame(context: Context, reader: RoadReader, named: Json) -> Seen:
    with context.database.reading() as session:
        frame = session.get_one(FrameRow, named["frame_id"])
        calibration = session.get_one(Calibration, named["calibration_id"])
        geometry = session.get_one(Calibration, named["geometry_id"]) if "geometry_id" in named else None
    try:
        with context.files.local(frame.sha256) as file, context.decoders.hold(file):
            task = Task(
                decoders=context.decoders,
                blobs=context.blobs,
                lend=_lend_nothing,
                frame=frame,
                file=file,
                calibration=calibration,
                parameters=named,
                report=lambda _share: None,
            )
            return reader.read(task, geometry)
    except DecoderCrashed as crash:
        context.files.prove(frame.sha256)
        raise InputRejected(files.DECODER_CRASHED, crash.message) from crash


@contextmanager
def _lend_nothing(frame_id: str) -> Any:  # noqa: ANN401  never entered
    raise AssertionError(f"{frame_id} is averaged with no other")
    yield
