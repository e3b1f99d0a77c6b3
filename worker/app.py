"""The Celery application: `celery -A worker.app worker -Q looks,frames,fits,maps`."""

from store.jobs.queues import make_celery
from store.settings import read_settings

settings = read_settings()
app = make_celery(settings.effective_broker_url, lease_s=settings.lease_s)
app.conf.update(
    include=["worker.process"],
    worker_concurrency=settings.worker_threads,
    worker_consumer="worker.consumer:Consumer",
    # a job that takes longer hangs: its process is killed, and it is lost as with its worker
    task_time_limit=3600.0,
    # a process opens its connections before it says that it is up: by default 4 s
    worker_proc_alive_timeout=60.0,
    # how long the last words of a process that has died are waited for; by default 10 s
    worker_lost_wait=2.0,
)
