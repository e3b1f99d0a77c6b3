"""The end of a worker that is asked to stop: what runs is finished, or given back for another worker."""

import logging
import os
import signal
import threading

from store.parts import Presence
from worker.leases import Leases
from worker.threads import JobThreads


class Stop:
    """Ends this process, once, however often it is asked to."""

    def __init__(self, threads: JobThreads, leases: Leases, presence: Presence, *, grace_s: float) -> None:
        self._threads = threads
        self._leases = leases
        self._presence = presence
        self._grace_s = grace_s
        self._once = threading.Lock()

    def heed_signals(self) -> None:
        """Stop at SIGTERM; not through Celery, which may be waiting for a broker that does not answer."""
        from celery.signals import worker_shutting_down

        signal.signal(signal.SIGTERM, lambda *_: self.begin())
        # Celery takes the signal over while it runs, and passes it on.
        worker_shutting_down.connect(self.begin, weak=False)

    def begin(self, **_told: object) -> None:
        """Stop in a thread of its own: a signal interrupts whoever happens to run."""
        threading.Thread(target=self.run, name="stop", daemon=True).start()

    def run(self) -> None:
        """Wait for the jobs that run while the grace lasts, give back the others, and end the process."""
        with self._once:
            self._threads.stop(self._grace_s)
            self._leases.give_back()
            self._presence.leave()
            logging.shutdown()
            # A thread that waits for a decoder or a peer would hold the process.
            os._exit(0)
