"""A road evaluated: the luminances of its points in every frame, and the verdict."""

from dataclasses import replace
from typing import Any

from sqlalchemy.orm import Session

from radiometry.road.evaluation import evaluate_road
from radiometry.road.grid import lay_points
from radiometry.road.rules import find_rule
from radiometry.road.site import Road as StatedRoad
from store import jobs
from store.codec import decode, encode
from store.measuring.roads import write_result
from store.tables import Calibration, FrameRow, Road
from worker.context import Context, Outcome
from worker.measuring.road import RoadReader, draw_road
from worker.tasks.measure import make_task


def evaluate(context: Context, claim: jobs.Claim) -> Outcome:
    """Read every frame that the plan names, and evaluate the road."""
    plan = claim.parameters
    stated = decode(StatedRoad, plan["road"])
    points = lay_points(stated.site, find_rule(stated.requirement.rule).grid)
    reader = RoadReader(stated, points)
    for number, named in enumerate(plan["frames"], start=1):
        with context.database.reading() as session:
            frame = session.get_one(FrameRow, named["frame_id"])
            calibration = session.get_one(Calibration, named["calibration_id"])
            geometry = session.get_one(Calibration, named["geometry_id"]) if "geometry_id" in named else None
        with context.lend(frame.sha256) as file:
            task = make_task(context, claim, frame, calibration, file)
            reader.read(replace(task, parameters=named), geometry)
        context.leases.report(claim, 0.9 * number / len(plan["frames"]))
    sight, scale = reader.finish()
    result = evaluate_road(stated, points, sight, scale=scale)
    png, shown = draw_road(reader.view, reader.above_cd_m2, result)
    picture = context.blobs.keep([png])

    def store(session: Session) -> dict[str, Any]:
        row = session.get_one(Road, claim.subject_id)
        kept = encode(result) | {"map": shown}
        made = write_result(session, row, plan, kept, picture, by=claim.created_by)
        link = f"/v1/roads/{row.id}/results/{made.number}"
        return {"result_id": made.id, "number": made.number, "result": link}

    return Outcome(store=store)
