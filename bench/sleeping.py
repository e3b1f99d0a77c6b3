"""Jobs that only take time: `celery -A worker.app worker -I bench.sleeping`."""

import time

from store.jobs import Claim
from worker import runner, tasks
from worker.context import Context


def _sleep(_context: Context, claim: Claim) -> tasks.Outcome:
    time.sleep(claim.parameters["lasts_s"])
    return tasks.Outcome(store=lambda _session: {})


runner.work = _sleep
