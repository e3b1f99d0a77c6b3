"""Vital signs of the service: its loop turns, and a thread is free now and then."""

import asyncio
import time
from typing import Any

from starlette.concurrency import run_in_threadpool

from service.attempts import Attempts
from service.rates import Rates
from store.jobs.processes import Presence
from store.pulse import Pulse

_LOOK_EVERY_S = 5.0
_SHARE_EVERY_S = 1.0
_THREADS_PATIENCE = 5
"""All threads may be at slow uploads for longer than a loop may stand still."""


class Vitals:
    """Goes the way of a request every few seconds, through loop and thread, and beats if it gets through."""

    def __init__(
        self, presence: Presence, pulse: Pulse, *, hang_s: float, rates: Rates, attempts: Attempts
    ) -> None:
        self._rates = rates
        self._attempts = attempts
        self._presence = presence
        self._pulse = pulse
        self._threads_within_s = _THREADS_PATIENCE * hang_s
        self._free_at = time.monotonic()

    async def keep(self) -> None:
        """Beat until cancelled."""
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._go_through_thread())
            tasks.create_task(self._share_counts())
            while True:
                if time.monotonic() - self._free_at < self._threads_within_s:
                    self._pulse.beat()
                await asyncio.sleep(_LOOK_EVERY_S)

    async def _share_counts(self) -> None:
        """Share what this process counts, whenever that has changed, and count with the others' counts."""
        told: dict[str, Any] = {}
        while True:
            await asyncio.sleep(_SHARE_EVERY_S)
            counts = {"requests": self._rates.tell(), "failures": self._attempts.tell()}
            if counts != told:
                told, heard = counts, await run_in_threadpool(self._presence.share, counts)
                self._rates.hear(each["requests"] for each in heard)
                self._attempts.hear(each["failures"] for each in heard)

    async def _go_through_thread(self) -> None:
        while True:
            await run_in_threadpool(self._presence.beat)
            self._free_at = time.monotonic()
            await asyncio.sleep(_LOOK_EVERY_S)
