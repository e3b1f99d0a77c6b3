"""One job, from its message to its end: worked on, stored in one commit if the fence still holds."""

import logging
import threading
import time
import traceback
from collections.abc import Callable, Mapping
from typing import Any

from sqlalchemy.exc import IntegrityError, InterfaceError, OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeout
from sqlalchemy.orm import Session

from radiometry.findings import InputRejected, files, interface
from store import jobs, log_fields
from store.blobs import BlobDamaged, Blobs, StorageFull, StorageUnavailable
from store.database import SchemaDiffers, summarise
from store.files import describe_damage
from store.jobs import Claim, Dependency, LeaseLost
from worker.context import Context
from worker.decode.pool import DecoderKilled, DecoderUnavailable
from worker.tasks import Outcome, work

log = logging.getLogger(__name__)

Ending = Callable[[Session], Mapping[str, Any]]
"""Ends a job in the transaction that also stores what it computed; returns how. It may be called twice."""

STORE_AWAY = (StorageUnavailable, StorageFull)
DATABASE_AWAY = (OperationalError, InterfaceError, PoolTimeout)
_AWAY: Mapping[Dependency, tuple[type[Exception], ...]] = {
    Dependency.DATABASE: DATABASE_AWAY,
    Dependency.BLOBS: STORE_AWAY,
    Dependency.DECODER: (DecoderUnavailable,),
}
_STORE_ATTEMPTS = 5
_KILLED_ATTEMPTS = 5
_PATIENCE_S = 1800.0  # how long a result is kept for a database that does not answer
_PAUSE_S = 0.5
_DROPPED: Mapping[str, Any] = {"state": "dropped"}


def run(context: Context, job_id: str) -> Mapping[str, Any]:
    """Do a job and end it, unless others have; how it has ended or goes on."""
    try:
        with context.database.writing("worker") as session:
            claim = jobs.begin(session, job_id, lease_s=context.settings.lease_s)
    except (SchemaDiffers, *DATABASE_AWAY):
        return _DROPPED  # upkeep tells, and sends it again
    return _DROPPED if claim is None else _run(context, claim)


def _run(context: Context, claim: Claim) -> Mapping[str, Any]:
    began = time.monotonic()
    known = {name: getattr(claim, name) for name in ("job_id", "kind", "subject_id", "attempt")}
    if claim.request_id:
        known["request_id"] = claim.request_id
    with context.leases.hold(claim), log_fields.fields(**known):
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
            return _DROPPED
        except (SchemaDiffers, *DATABASE_AWAY) as fault:
            log.warning("%s is not ended, its lease will run out: %s", claim.job_id, summarise(fault))
            return _DROPPED
        took_s = time.monotonic() - began
        context.durations.observe(claim.kind, took_s)
        log.info("job", extra={"fields": {**ended, "duration_s": round(took_s, 4)}})
        return ended


def problem(code: str, detail: str) -> dict[str, Any]:
    return {"code": str(code), "detail": detail, "retryable": False}


def _work(context: Context, claim: Claim) -> Ending:
    try:
        outcome = work(context, claim)
    except InputRejected as refusal:
        return _store(claim, Outcome(store=lambda _session: {}, rejection=refusal))
    except BlobDamaged as damage:
        log.warning("%s waits for an upload: %s", claim.job_id, damage)
        found = problem(interface.STORED_FILE_DAMAGED, describe_damage(damage)) | {"sha256": damage.sha256}
        return _fail(claim, found)
    except DecoderKilled as killed:
        return _after_kill(claim, killed)
    except Exception as fault:
        dependency = next((each for each, faults in _AWAY.items() if isinstance(fault, faults)), None)
        if dependency is None:
            log.exception("%s failed", claim.job_id)
            return _fail_as_ours(claim, traceback.format_exc())
        log.info("%s is tried again later: %s", claim.job_id, summarise(fault))
        return _retry_later(claim, dependency, alone=dependency is Dependency.BLOBS and serves(context.blobs))
    return _store(claim, outcome)


def serves(blobs: Blobs) -> bool:
    """Return True if the file store does: what failed then is one object's fault."""
    try:
        blobs.check()
    except STORE_AWAY:
        return False
    return True


def _store(claim: Claim, outcome: Outcome) -> Ending:
    def end(session: Session) -> Mapping[str, Any]:
        result = outcome.store(session)
        if outcome.rejection is not None:
            return _fail(claim, problem(outcome.rejection.code, outcome.rejection.message))(session)
        jobs.succeed(session, claim, result)
        ids = {name: value for name, value in result.items() if name.endswith("_id")}
        return {"state": "succeeded", **ids}

    return end


def _fail(claim: Claim, error: dict[str, Any], trace: str | None = None) -> Ending:
    def end(session: Session) -> Mapping[str, Any]:
        jobs.fail(session, claim, error, trace)
        return {"state": "failed", "code": error["code"]}

    return end


def _retry_later(claim: Claim, dependency: Dependency, *, alone: bool = False) -> Ending:
    def end(session: Session) -> Mapping[str, Any]:
        if (due_at := jobs.retry_later(session, claim, waits_for=dependency, alone=alone)) is None:
            return {"state": "failed", "code": str(interface.TEMPORARILY_UNAVAILABLE)}
        return {"state": "queued", "waits_for": str(dependency), "due_at": due_at.isoformat()}

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
            pause.wait(_PAUSE_S)
        else:
            return ended
