"""Queues of Celery: the task and queue of a job, whose row is the truth, and whose message is sent next."""

import logging
import threading
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from datetime import timedelta
from functools import cached_property
from typing import TYPE_CHECKING, Final, NamedTuple, TypeVar

from sqlalchemy import ColumnElement, func, literal_column, select, update
from sqlalchemy.orm import Session

from store.tables import Job, Turn, utc_now

if TYPE_CHECKING:
    from celery import Celery


log = logging.getLogger(__name__)

_T = TypeVar("_T")


class Lane(NamedTuple):
    queue: str
    task: str


LANES: Final = {
    "look": Lane("looks", "stilb.look"),
    "extract": Lane("frames", "stilb.extract"),
    "renewal": Lane("frames", "stilb.extract"),
    "fit": Lane("fits", "stilb.fit"),
    "measure": Lane("maps", "stilb.measure"),
    "flight": Lane("maps", "stilb.measure"),
}
"""By `Job.lane`; of one queue an organisation's first lane is served first."""
QUEUES: Final = tuple(dict.fromkeys(lane.queue for lane in LANES.values()))
REVIEW: Final = Lane("fits", "stilb.review")
CANCEL: Final = Lane("fits", "stilb.cancel")
WINDOW: Final = 4  # messages of a queue in the broker: who brings one job waits for so many others there
LOST_AFTER_S: Final = 2.0

IS_QUEUED = Job.state == literal_column("'queued'")  # as its index has it: SQLite compares the words

_SILENCE_AFTER_FAILURE_S: Final = 2.0
_SENT_WITHIN_S: Final = 1.0


class Message(NamedTuple):
    """Message of a job: the row has the rest, and the subject is for those who watch."""

    lane: Lane
    task_id: str | None
    subject_id: str


def make_celery(broker_url: str, *, lease_s: float = 30.0, answer_within_s: float | None = None) -> "Celery":
    """The application of senders, who know the tasks by name, and of workers."""
    from celery import Celery
    from kombu.entity import Queue

    app = Celery("stilb", broker=broker_url)
    app.conf.update(
        task_queues=[Queue(name, routing_key=name) for name in QUEUES],  # type: ignore[no-untyped-call]
        task_default_queue=REVIEW.queue,
        task_ignore_result=True,
        # a message leaves the broker when its task has ended, and comes back if its process or worker is lost
        task_acks_late=True,
        task_reject_on_worker_lost=True,
        worker_prefetch_multiplier=1,
        # its socket is polled while all places are taken, which tells that the broker is gone
        worker_enable_remote_control=True,
        worker_send_task_events=True,
        worker_cancel_long_running_tasks_on_connection_loss=False,
        broker_connection_retry_on_startup=True,
        broker_connection_max_retries=None,
        broker_transport_options={
            "visibility_timeout": 10 * lease_s,
            "health_check_interval": max(1, round(lease_s / 6)),
            "socket_connect_timeout": 1.0,
            "socket_timeout": answer_within_s or max(1.0, lease_s / 6),
        },
        worker_hijack_root_logger=False,
    )
    return app


class Post:
    """Sends messages, and never fails: what is not sent is found by the workers' upkeep."""

    def __init__(self, broker_url: str) -> None:
        self._broker_url = broker_url
        self._silent_until = 0.0
        self._lock = threading.Lock()

    @cached_property
    def _celery(self) -> "Celery":
        celery = make_celery(self._broker_url, answer_within_s=_SENT_WITHIN_S)
        # `retry=False` alone would still leave six seconds of attempts to connect
        celery.conf.broker_transport_options["max_retries"] = 0
        return celery

    def send(self, messages: Sequence[Message]) -> None:
        def send() -> None:
            with self._celery.producer_or_acquire() as producer:
                for lane, task_id, subject_id in messages:
                    way = {"queue": lane.queue, "producer": producer, "retry": False}
                    self._celery.send_task(lane.task, args=[subject_id], task_id=task_id, **way)

        if messages:
            self._attempt(send)

    def count(self) -> dict[str, int] | None:
        def count() -> dict[str, int]:
            with self._celery.producer_or_acquire() as producer:
                return {name: producer.channel.queue_declare(name).message_count for name in QUEUES}

        return self._attempt(count)

    def _attempt(self, action: Callable[[], _T]) -> _T | None:
        from kombu.exceptions import OperationalError
        from redis.exceptions import RedisError

        with self._lock:
            # Looked at behind the lock: those who waited for one that failed do not try one by one.
            if time.monotonic() < self._silent_until:
                return None
            try:
                return action()
            except (OperationalError, RedisError, OSError) as error:
                log.warning("the broker does not serve; jobs are sent later: %s", error)
                self._silent_until = time.monotonic() + _SILENCE_AFTER_FAILURE_S
                return None


def of_queue(queue: str) -> ColumnElement[bool]:
    return Job.lane.in_([lane for lane, each in LANES.items() if each.queue == queue])


def touch(session: Session, *queues: str) -> None:
    """Have the end of this transaction choose what these queues, or all, send."""
    session.info.setdefault("queues", set()).update(queues or QUEUES)


def choose_messages(session: Session) -> list[Message]:
    """Choose what is sent next of the queues that this transaction has touched: in turn by organisation."""
    touched: Collection[str] = session.info.pop("queues", ())
    # in one order, since each is locked
    return [message for queue in sorted(touched) for message in _fill(session, queue)]


def needs_files(queue: str) -> bool:
    return queue != "fits"


def is_held_back(session: Session, queue: str) -> bool:
    """Return True if a queue's jobs need files, and others have found that the file store does not serve."""
    waiting = select(Job.id).where(IS_QUEUED, Job.waits_for == "blobs").limit(1)
    return needs_files(queue) and session.scalar(waiting) is not None


def unsend_lost(session: Session, waiting: dict[str, int]) -> None:
    """Forget what was sent and not begun where fewer messages wait in the broker."""
    before = utc_now() - timedelta(seconds=LOST_AFTER_S)
    for queue, count in waiting.items():
        sent = of_queue(queue) & IS_QUEUED & Job.sent_at.is_not(None)
        if count < _count(session, sent):
            # a time ahead was written before the clock was set back
            late = ~Job.sent_at.between(before, utc_now())
            session.execute(update(Job).where(sent, late).values(sent_at=None))


def _fill(session: Session, queue: str) -> Iterator[Message]:
    sent = of_queue(queue) & IS_QUEUED & Job.sent_at.is_not(None)
    if _count(session, sent) >= WINDOW:
        return
    turn = session.get_one(Turn, queue, with_for_update=True, populate_existing=True)
    held_back = is_held_back(session, queue)
    for _ in range(WINDOW - _count(session, sent)):
        # what was tried while the file store was away is tried again, ever more seldom
        away = of_queue(queue) & IS_QUEUED & Job.waits_for.is_not(None)
        message = _mark_first(session, away) if held_back else _serve_next(session, turn)
        if message is None:
            return
        yield message


def _serve_next(session: Session, turn: Turn) -> Message | None:
    """Choose a job of the organisation after the one that was served last."""
    names = [name for name in LANES if LANES[name].queue == turn.queue]
    lanes = [(Job.state == "queued") & (Job.lane == name) for name in names]
    if (chosen := _next_organisation(session, lanes, turn.organisation_id)) is None:
        return None
    turn.organisation_id = chosen
    found = (_mark_first(session, lane & (Job.organisation_id == chosen)) for lane in lanes)
    return next(filter(None, found), None)


def _mark_first(session: Session, which: ColumnElement[bool]) -> Message | None:
    which &= _is_ready()
    first = select(Job.id).where(which).order_by(Job.due_at).limit(1)
    # the state once more: between its two looks at the row PostgreSQL may see another's commit
    mine = (Job.id == first.with_for_update(skip_locked=True).scalar_subquery()) & which
    marked = update(Job).where(mine).values(sent_at=utc_now()).returning(Job.lane, Job.id, Job.subject_id)
    row = session.execute(marked.execution_options(synchronize_session=False)).first()
    return Message(LANES[row.lane], row.id, row.subject_id) if row else None


def _is_ready() -> ColumnElement[bool]:
    return Job.sent_at.is_(None) & (Job.due_at <= utc_now())


def _next_organisation(session: Session, lanes: Sequence[ColumnElement[bool]], last: str) -> str | None:
    """Return the next organisation after the last one that has a job which is ready, else the first."""
    for after in (last, ""):
        found: list[str] = []
        for lane in lanes:
            theirs = select(Job.organisation_id).where(lane, _is_ready(), Job.organisation_id > after)
            found += session.scalars(theirs.order_by(Job.organisation_id).limit(1))
        if found:
            return min(found)
    return None


def _count(session: Session, which: ColumnElement[bool]) -> int:
    return session.scalar(select(func.count()).select_from(Job).where(which)) or 0
