"""`python -m worker -Q ...`: Celery's command `worker` without its others, whose shells take 7 MB."""

import sys

# Celery's help does without colours then, and 2 MB less
sys.modules["pygments"] = None  # type: ignore[assignment]

from celery.bin.base import CLIContext
from celery.bin.worker import worker

from worker.app import app

worker(obj=CLIContext(app, no_color=False, workdir=None))
