"""Tasks, one for each kind of job."""

from typing import Any

from sqlalchemy.orm import Session

from radiometry import methods
from store import fits
from store.jobs import Claim
from store.measuring.version import correct
from store.queries.evidence import gather
from store.tables import Campaign
from worker.context import Context, Outcome
from worker.tasks import look, measure, road
from worker.tasks.extract import extract

__all__ = ["Outcome", "work"]


def work(context: Context, claim: Claim) -> Outcome:
    """Compute what a job asks for, without storing it."""
    match claim.kind:
        case "extract" if "polygon" in claim.parameters:
            return look.look(context, claim)
        case "extract" if "window" in claim.parameters:
            return look.crop(context, claim)
        case "extract":
            return extract(context, claim)
        case "fit":
            return fit(context, claim)
        case "measure" if "road" in claim.parameters:
            return road.evaluate(context, claim)
        case "measure":
            return measure.measure(context, claim)
        case kind:
            raise AssertionError(f"no such kind of job: {kind}")


def fit(context: Context, claim: Claim) -> Outcome:
    """Fit from stored rows; nothing is decoded here."""
    with context.database.reading() as session:
        campaign = session.get_one(Campaign, claim.subject_id)
        params = fits.read_params(campaign, claim.parameters)
        gathered = gather(session, campaign)
        params = fits.leave_out_doubtful(params, gathered)
        evidence = correct(session, campaign, gathered, params)
    fitted = methods.get_method(campaign.method).fit(evidence.frames, evidence.readings, params)
    with context.database.reading() as session:
        new = fits.make_version(session, campaign, evidence, params, fitted, by=claim.created_by)

    def store(session: Session) -> dict[str, Any]:
        calibration = fits.write_version(session, new)
        return {"calibration_id": calibration.id, "calibration": f"/v1/calibrations/{calibration.id}"}

    return Outcome(store=store)
