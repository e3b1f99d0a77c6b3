"""The application of a worker that takes half a second for a job that hangs."""

from worker.app import app

app.conf.task_time_limit = 0.5
