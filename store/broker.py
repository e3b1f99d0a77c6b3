"""Hints to the workers: a Celery message that wakes one of them, which then asks the database what to do."""

import logging
import threading
import time
from functools import cached_property
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from celery import Celery

RUN_TASK = "stilb.run"
_SILENCE_AFTER_FAILURE_S = 2.0
_HINT_WITHIN_S = 1.0
_ANSWER_WITHIN_S = 30.0
MOST_HINTS = 64
"""Messages for any number of jobs: one wakes a worker, and a worker that finds work wakes all its threads.
Where more workers than this are idle, the others find work when they look without one."""

log = logging.getLogger(__name__)


def make_celery(broker_url: str, *, answer_within_s: float = _ANSWER_WITHIN_S) -> "Celery":
    """The Celery application that both sides share: the sender by the task's name, the worker by its body.

    A worker waits for messages and has to be patient; who only sends has not.
    """
    from celery import Celery

    app = Celery("stilb", broker=broker_url)
    app.conf.update(
        # Acknowledged early, as by default: a message lost with its worker is no loss. One acknowledged late
        # keeps one of the consumer's places for ever if the connection breaks in between.
        task_ignore_result=True,
        broker_connection_retry_on_startup=True,
        broker_connection_max_retries=None,
        broker_transport_options={
            # these would turn every second; a message that comes back late is no loss
            "polling_interval": 10,
            "unacked_restore_interval": 30,
            "unacked_restore_throttle": 1,
            "socket_connect_timeout": 1.0,
            "socket_timeout": answer_within_s,
        },
        worker_hijack_root_logger=False,
        worker_enable_remote_control=False,
    )
    return app


class Hints:
    """Sends hints, and never fails: what is not hinted is found when a worker looks without one.

    After a failure it stays silent for two seconds: a broker that is down or hangs delays one request by a
    second, not each. Where MOST_HINTS wait already, none is added: whoever takes them finds every job.
    """

    def __init__(self, broker_url: str) -> None:
        self._broker_url = broker_url
        self._silent_until = 0.0
        self._lock = threading.Lock()

    @cached_property
    def _celery(self) -> "Celery":
        celery = make_celery(self._broker_url, answer_within_s=_HINT_WITHIN_S)
        # `retry=False` alone would still leave six seconds of attempts to connect
        celery.conf.broker_transport_options["max_retries"] = 0
        return celery

    def send(self, job_ids: list[str]) -> None:
        """Send messages to the workers that these jobs wait."""
        if not job_ids:
            return
        from kombu.exceptions import OperationalError
        from redis.exceptions import RedisError

        with self._lock:
            # Looked at behind the lock: those who waited for one that failed do not try one by one.
            if time.monotonic() < self._silent_until:
                return
            try:
                self._send(job_ids)
            except (OperationalError, RedisError, OSError) as error:
                log.warning("no hint for %s, a worker will find it: %s", job_ids[0], error)
                self._silent_until = time.monotonic() + _SILENCE_AFTER_FAILURE_S

    def _send(self, job_ids: list[str]) -> None:
        with self._celery.producer_or_acquire() as producer:
            # without a worker nobody takes them away
            waiting = producer.channel.queue_declare(self._celery.conf.task_default_queue).message_count
            for job_id in job_ids[: max(MOST_HINTS - waiting, 0)]:
                self._celery.send_task(RUN_TASK, args=[job_id], producer=producer, retry=False)
