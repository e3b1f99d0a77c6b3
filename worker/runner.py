"""One job, from its hint to its end: claimed, worked on, stored in one commit if the fence still holds."""

import logging
import traceback
from typing import Any

from sqlalchemy.exc import IntegrityError, OperationalError

from radiometry.errors import InputRejected
from store import jobs
from store.blobs import StorageFull, StorageUnavailable
from worker.context import Context
from worker.decode.pool import DecoderUnavailable
from worker.tasks import Outcome, work

log = logging.getLogger(__name__)

TRANSIENT = (OperationalError, StorageUnavailable, StorageFull, DecoderUnavailable)
_STORE_ATTEMPTS = 5


def run(context: Context, job_id: str) -> None:
    """Do the job unless somebody else does, or did: a hint may come twice, late, or for nothing."""
    with context.database.writing("worker") as session:
        claim = jobs.claim(session, job_id, lease_s=context.leases.lease_s)
    if claim is None:
        return
    with context.leases.hold(claim):
        try:
            _work(context, claim)
        except jobs.LeaseLost:
            log.warning("%s is another worker's now; what was computed here is dropped", job_id)


def _work(context: Context, claim: jobs.Claim) -> None:
    try:
        _store(context, claim, work(context, claim))
    except jobs.LeaseLost:
        raise
    except InputRejected as error:
        _end(context, claim, problem(error.code, error.message))
    except TRANSIENT as error:
        log.warning("%s is tried again later: %s", claim.job_id, error)
        detail = "Something that this needs did not answer; it is tried again by itself."
        with context.database.writing("worker") as session:
            jobs.retry_later(session, claim, problem("temporarily_unavailable", detail, retryable=True))
    except Exception:
        log.exception("%s failed", claim.job_id)
        detail = "This is our fault; the operator finds the reason with the job. The upload is safe."
        _end(context, claim, problem("internal_error", detail), traceback.format_exc())


def problem(code: str, detail: str, *, retryable: bool = False) -> dict[str, Any]:
    return {"code": str(code), "detail": detail, "retryable": retryable}


def _store(context: Context, claim: jobs.Claim, outcome: Outcome) -> None:
    """Everything in one commit. Two that number a version at once collide: the later looks again."""
    for attempt in range(_STORE_ATTEMPTS):
        try:
            with context.database.writing("worker", claim.organisation_id) as session:
                result = outcome.store(session)
                if outcome.rejection is None:
                    jobs.succeed(session, claim, result)
                else:
                    rejection = problem(outcome.rejection.code, outcome.rejection.message)
                    jobs.fail(session, claim, rejection)
        except IntegrityError:
            if attempt == _STORE_ATTEMPTS - 1:
                raise
        else:
            return


def _end(context: Context, claim: jobs.Claim, error: dict[str, Any], trace: str | None = None) -> None:
    with context.database.writing("worker", claim.organisation_id) as session:
        jobs.fail(session, claim, error, trace)
