"""A campaign's rows and readings into the next version of its camera's calibration."""

from typing import Any

from sqlalchemy.orm import Session

from radiometry import methods
from store import fits, jobs
from store.measuring.version import correct
from store.queries.evidence import gather
from store.tables import Campaign
from worker.context import Context, Outcome


def fit(context: Context, claim: jobs.Claim) -> Outcome:
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
