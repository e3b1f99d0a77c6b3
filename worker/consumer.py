"""The consumer of a worker: Celery's, which also notices that the broker has lost what it holds."""

from collections.abc import Callable
from functools import partial
from typing import Any

from celery.worker import state
from celery.worker.consumer import Consumer as CeleryConsumer
from celery.worker.loops import asynloop
from redis.exceptions import ConnectionError as BrokerLost

from worker.process import tend

_LOOK_EVERY_S = 2.0


class Consumer(CeleryConsumer):  # type: ignore[misc]
    """Connects anew when it holds a message for two seconds that no task has: its acknowledgement failed.

    Celery only logs that, and such a message takes one of its places for ever: after a broker that froze,
    all of them. Nor does it wait longer than two seconds to connect again, by default up to thirty.
    """

    class Blueprint(CeleryConsumer.Blueprint):  # type: ignore[misc]
        # who else is there changes nothing here, and asking delays the start by a second
        _every = CeleryConsumer.Blueprint.default_steps
        default_steps = tuple(step for step in _every if not step.endswith((":Mingle", ":Gossip")))

    def ensure_connected(self, conn: Any) -> Any:  # noqa: ANN401  kombu's
        def wait(look_for_stop: Callable[[], None]) -> None:
            tend()
            look_for_stop()

        ensure = conn.ensure_connection
        pauses = {"interval_start": 0.2, "interval_step": 0.3, "interval_max": 2.0}
        conn.ensure_connection = lambda errback, retries, callback: ensure(
            errback, retries, callback=partial(wait, callback), **pauses
        )
        return super().ensure_connected(conn)

    def loop(self, *arguments: Any) -> None:  # noqa: ANN401  Celery's
        """Celery's loop, in which a job may end whose connection is half closed: kombu then finds None."""
        try:
            asynloop(*arguments)
        except AttributeError as error:
            if (error.name, error.obj) != ("hostname", None):
                raise
            raise BrokerLost("a message could not be acknowledged") from error

    def on_connection_error_after_connected(self, exc: Exception) -> None:
        try:
            super().on_connection_error_after_connected(exc)
        except AttributeError:  # kombu 5.7 may close a channel twice: 'NoneType' has no attribute 'hostname'
            self.connection = None

    def register_with_event_loop(self, hub: Any) -> None:  # noqa: ANN401  kombu's
        super().register_with_event_loop(hub)
        before: set[str] = set()

        def look() -> None:
            nonlocal before
            tend()
            qos = self.task_consumer.channel.qos
            known = {request.message.delivery_tag for request in tuple(state.reserved_requests)}
            orphans = set(qos._delivered) - set(qos._dirty) - known  # noqa: SLF001  nothing public tells
            if orphans & before:
                raise BrokerLost("messages are held that no task has")
            before = orphans

        # cancelled with the connection
        hub.call_repeatedly(_LOOK_EVERY_S, look)
