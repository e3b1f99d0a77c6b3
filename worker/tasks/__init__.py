"""Tasks, one for each kind of job."""

from store.jobs import Claim
from worker.context import Context, Outcome
from worker.tasks import fit, look, measure, road
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
            return fit.fit(context, claim)
        case "measure" if "road" in claim.parameters:
            return road.evaluate(context, claim)
        case "measure":
            return measure.measure(context, claim)
        case kind:
            raise AssertionError(f"no such kind of job: {kind}")
