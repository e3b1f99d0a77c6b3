"""`python -m worker -Q ...`: Celery's command `worker` without its others, whose shells take 7 MB."""

import gc
import sys

_USUAL = gc.get_threshold()
# Seldom until everything is imported, as in service/__main__.py.
gc.set_threshold(20_000, 20, 20)

# Celery's help does without colours then, and 2 MB less
sys.modules["pygments"] = None  # type: ignore[assignment]

from celery.bin.base import CLIContext
from celery.bin.worker import worker

from worker.app import app

app.loader.import_default_modules()
gc.set_threshold(*_USUAL)
worker(obj=CLIContext(app, no_color=False, workdir=None))
