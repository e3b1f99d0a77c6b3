"""Jobs that only take time: `celery -A worker.app worker -I bench.sleeping`."""

import time

from store.jobs import Claim
from worker import runner
from worker.context import Context
from worker.tasks import Outcome


def _sleep(context: Context, claim: Claim) -> Outcome:
    if claim.kind == "extract":
        context.blobs.check()
    time.sleep(claim.parameters["lasts_s"])
    return Outcome(store=lambda _session: {})


runner.work = _sleep
