"""Ties a child process to the life of the one that starts it, even if that one is killed with -9."""

import ctypes
import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path

_PR_SET_PDEATHSIG = 1


def die_with_parent(sig: signal.Signals = signal.SIGKILL) -> Callable[[], None]:
    """Return a `preexec_fn` with which the kernel sends the child a signal when its parent dies.

    The parent is the thread that starts the child, not its process: call `Popen` from the main thread. A
    change of user clears the setting, but `Popen(user=...)` makes that change before it calls this.
    """
    # Made here, since between fork and exec a child of a process with threads may take no lock.
    return _tie(os.getpid(), sig)


def follow_make() -> None:
    """Die with the `make` that runs this: whoever kills it with -9 holds no other handle on us."""
    parent = os.getppid()
    try:
        name = Path(f"/proc/{parent}/comm").read_text(encoding="utf-8").strip()
    except OSError:
        return
    if name in {"make", "gmake"}:
        _tie(parent, signal.SIGKILL)()


def _tie(parent: int, sig: signal.Signals) -> Callable[[], None]:
    if sys.platform != "linux":
        return _nothing
    prctl = ctypes.CDLL(None, use_errno=True).prctl

    def tie() -> None:
        prctl(_PR_SET_PDEATHSIG, int(sig), 0, 0, 0)
        # The parent may have died before the line above: then no signal will ever come.
        if os.getppid() != parent:
            os._exit(1)

    return tie


def _nothing() -> None:
    pass
