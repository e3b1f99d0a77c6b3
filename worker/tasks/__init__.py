"""Tasks, one for each kind of job."""

from store.jobs import Claim
from worker.context import Context
from worker.tasks.crop import crop
from worker.tasks.extract import extract
from worker.tasks.fit import fit
from worker.tasks.look import look
from worker.tasks.measure import measure
from worker.tasks.outcome import Outcome

__all__ = ["Outcome", "work"]


def work(context: Context, claim: Claim) -> Outcome:
    """Compute what a job asks for, without storing it."""
    match claim.kind:
        case "extract" if "polygon" in claim.parameters:
            return look(context, claim)
        case "extract" if "window" in claim.parameters:
            return crop(context, claim)
        case "extract":
            return extract(context, claim)
        case "fit":
            return fit(context, claim)
        case "measure":
            return measure(context, claim)
        case kind:
            raise AssertionError(f"no such kind of job: {kind}")
