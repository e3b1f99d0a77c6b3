"""Ties a child process to the life of the one that starts it, even if that one is killed with -9."""

import ctypes
import os
import signal
import sys
from collections.abc import Callable

_PR_SET_PDEATHSIG = 1


def die_with_parent(sig: signal.Signals = signal.SIGKILL) -> Callable[[], None]:
    """Return a `preexec_fn` with which the kernel sends the child a signal when its parent dies.

    The parent is the thread that starts the child, not its process: call `Popen` from the main thread. A
    change of user clears the setting, but `Popen(user=...)` makes that change before it calls this.
    """
    if sys.platform != "linux":
        return _nothing
    # Looked up here, since between fork and exec a child of a process with threads may take no lock.
    prctl = ctypes.CDLL(None, use_errno=True).prctl
    parent = os.getpid()

    def tie() -> None:
        prctl(_PR_SET_PDEATHSIG, int(sig), 0, 0, 0)
        # The parent may have died between the fork and the line above: then no signal will ever come.
        if os.getppid() != parent:
            os._exit(1)

    return tie


def _nothing() -> None:
    pass
