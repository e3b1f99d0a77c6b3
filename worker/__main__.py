"""`python -m worker -Q ...`: Celery's command `worker` without its others, whose shells take 7 MB."""

from celery.bin.base import CLIContext
from celery.bin.worker import worker

from worker.app import app

worker(obj=CLIContext(app, no_color=False, workdir=None))
