"""Hints to the workers: a Celery message that carries a job's id and nothing else."""

import logging
import threading
import time

from celery import Celery
from kombu.exceptions import OperationalError
from redis.exceptions import RedisError

RUN_TASK = "stilb.run"
_SILENCE_AFTER_FAILURE_S = 2.0

log = logging.getLogger(__name__)


def make_celery(broker_url: str) -> Celery:
    """The Celery application that both sides share: the sender by the task's name, the worker by its body."""
    app = Celery("stilb", broker=broker_url)
    app.conf.update(
        task_acks_late=True,
        task_reject_on_worker_lost=True,
        worker_prefetch_multiplier=1,
        task_ignore_result=True,
        broker_connection_retry_on_startup=True,
        broker_connection_max_retries=None,
        broker_transport_options={
            # without these two a message of a killed worker comes back after 90 s
            "unacked_restore_interval": 1,
            "unacked_restore_throttle": 1,
            "socket_connect_timeout": 1.0,
            "socket_timeout": 30.0,
        },
        worker_cancel_long_running_tasks_on_connection_loss=False,
        worker_hijack_root_logger=False,
        worker_send_task_events=False,
        worker_enable_remote_control=False,
    )
    return app


class Hints:
    """Sends hints, and never fails: what is not hinted is found by the sweeper.

    After a failure it stays silent for two seconds: a broker that is down delays one request, not each.
    """

    def __init__(self, celery: Celery) -> None:
        self._celery = celery
        self._silent_until = 0.0
        self._lock = threading.Lock()

    def send(self, job_ids: list[str]) -> None:
        """Tell some worker that these jobs wait."""
        if time.monotonic() < self._silent_until:
            return
        for job_id in job_ids:
            try:
                with self._lock:
                    self._celery.send_task(RUN_TASK, args=[job_id], retry=False, ignore_result=True)
            except (OperationalError, RedisError, OSError) as error:
                log.warning("no hint for %s, the sweeper will find it: %s", job_id, error)
                self._silent_until = time.monotonic() + _SILENCE_AFTER_FAILURE_S
                return
