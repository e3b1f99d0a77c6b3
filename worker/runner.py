"""One job, from its claim to its end: worked on, stored in one commit if the fence still holds."""

import logging
import threading
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from radiometry.findings import InputRejected, files, interface
from store import jobs
from store.blobs import BlobDamaged
from store.database import summarise
from store.files import describe_damage
from store.jobs import Claim, Dependency, LeaseLost, Turn
from store.log_fields import fields
from store.schema import SchemaDiffers
from store.tracing import span
from worker.context import Context
from worker.decode.pool import DecoderKilled
from worker.needs import DATABASE_AWAY, find_dependency
from worker.tasks import Outcome, work

log = logging.getLogger(__name__)

Ending = Callable[[Session], Mapping[str, Any]]
"""Ends a job in the transaction that also stores what it computed; returns how. It may be called twice."""

_STORE_ATTEMPTS = 5
_KILLED_ATTEMPTS = 5
_PATIENCE_S = 3600.0
"""How long a result is kept for a database that does not answer."""
_PAUSE_S = 0.5


def claim_next(context: Context, turn: Turn) -> Claim | None:
    """Claim the next job that is due and whose dependencies serve; None when there is none."""
    held_back, claim = context.needs.list_held_back(), None
    try:
        with context.database.writing("worker") as session:
            claim = jobs.claim_next(session, turn, lease_s=context.leases.lease_s, without=held_back)
    finally:
        context.needs.choose(claim.kind if claim else None)
    return claim


def run(context: Context, claim: Claim) -> None:
    """Do a job and end it, unless another worker holds it by then."""
    began = time.monotonic()
    told = {"kind": claim.kind, "subject_id": claim.subject_id, "attempt": claim.attempt}
    if claim.request_id:
        told["request_id"] = claim.request_id
    known = {"job_id": claim.job_id, **told}
    traced = span(f"job {claim.kind}", kind="CONSUMER", parent=claim.traceparent, known=known)
    with context.leases.hold(claim), fields(**known), traced as note:
        ending = _work(context, claim)
        try:
            try:
                ended = _end(context, claim, ending)
            except (LeaseLost, SchemaDiffers, *DATABASE_AWAY):
                raise
            except Exception:
                log.exception("%s failed when it was stored", claim.job_id)
                ended = _end(context, claim, _fail_as_ours(claim, traceback.format_exc()))
        except LeaseLost:
            log.warning("%s is another worker's now; what was computed here is dropped", claim.job_id)
        except DATABASE_AWAY as fault:
            log.warning("%s is not ended, its lease will run out: %s", claim.job_id, summarise(fault))
        else:
            took_s = time.monotonic() - began
            context.durations.observe(claim.kind, took_s)
            log.info("job", extra={"fields": {**ended, "duration_s": round(took_s, 4)}})
            note(ended, failed=ended["state"] == "failed")


def problem(code: str, detail: str) -> dict[str, Any]:
    return {"code": str(code), "detail": detail, "retryable": False}


def _work(context: Context, claim: Claim) -> Ending:
    """Compute, and return how the job ends."""
    try:
        outcome = work(context, claim)
    except InputRejected as refusal:
        outcome = Outcome(store=lambda _session: {}, rejection=refusal)
    except BlobDamaged as damage:
        context.needs.fail(None, damage)
        log.warning("%s waits for an upload: %s", claim.job_id, damage)
        found = problem(interface.STORED_FILE_DAMAGED, describe_damage(damage)) | {"sha256": damage.sha256}
        return _fail(claim, found)
    except DecoderKilled as killed:
        context.needs.fail(None, killed)
        return _after_kill(claim, killed)
    except Exception as fault:
        dependency = find_dependency(fault)
        context.needs.fail(dependency, fault)
        if dependency is None:
            log.exception("%s failed", claim.job_id)
            return _fail_as_ours(claim, traceback.format_exc())
        log.info("%s is tried again later: %s", claim.job_id, summarise(fault))
        return _retry_later(claim, dependency)
    return _store(claim, outcome, back=context.needs.serve(claim.kind))


def _store(claim: Claim, outcome: Outcome, *, back: Sequence[Dependency]) -> Ending:
    def end(session: Session) -> Mapping[str, Any]:
        result = outcome.store(session)
        if outcome.rejection is None:
            jobs.succeed(session, claim, result)
            ids = {name: value for name, value in result.items() if name.endswith("_id")}
            ended = {"state": "succeeded", **ids}
        else:
            found = problem(outcome.rejection.code, outcome.rejection.message)
            ended = dict(_fail(claim, found)(session))
        for dependency in back:
            jobs.resume(session, dependency)
        return ended

    return end


def _fail(claim: Claim, error: dict[str, Any], trace: str | None = None) -> Ending:
    def end(session: Session) -> Mapping[str, Any]:
        jobs.fail(session, claim, error, trace)
        return {"state": "failed", "code": error["code"]}

    return end


def _retry_later(claim: Claim, dependency: Dependency) -> Ending:
    def end(session: Session) -> Mapping[str, Any]:
        jobs.retry_later(session, claim, waits_for=dependency)
        return {"state": "queued", "waits_for": str(dependency)}

    return end


def _after_kill(claim: Claim, killed: DecoderKilled) -> Ending:
    """Try again some times what says nothing about the file, which is never refused for it."""
    if claim.attempt < _KILLED_ATTEMPTS:
        log.warning("%s is tried again later: %s", claim.job_id, killed)
        return _retry_later(claim, Dependency.DECODER)
    return _fail(claim, problem(files.DECODER_CRASHED, killed.message) | {"retryable": True})


def _fail_as_ours(claim: Claim, trace: str) -> Ending:
    detail = "This is our fault; the operator finds the reason with the job. The upload is safe."
    return _fail(claim, problem(interface.INTERNAL_ERROR, detail), trace)


def _end(context: Context, claim: Claim, ending: Ending) -> Mapping[str, Any]:
    """End a job in one commit.

    Two that number a version at once collide: the later looks again. A database that does not answer is
    waited for; the lease may run out meanwhile, and the fence decides.
    """
    pause, give_up_at, collisions = threading.Event(), time.monotonic() + _PATIENCE_S, 0
    while True:
        try:
            with context.database.writing("worker", claim.organisation_id) as session:
                ended = ending(session)
        except IntegrityError:
            collisions += 1
            if collisions == _STORE_ATTEMPTS:
                raise
        except DATABASE_AWAY:
            if time.monotonic() > give_up_at:
                raise
            # it does not hang: its lease is to be renewed as soon as that is possible
            context.leases.report(claim, 1.0)
            pause.wait(_PAUSE_S)
        else:
            return ended
