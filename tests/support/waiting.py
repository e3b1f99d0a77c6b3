"""Waiting for something that is about to happen: never for ever, and by name."""

import inspect
import time
from collections.abc import Callable

PATIENCE_S = 90.0


def wait_for(
    condition: Callable[[], object],
    what: str = "",
    *,
    timeout_s: float = PATIENCE_S,
    seen: Callable[[], object] | None = None,
) -> None:
    """Wait until the condition holds; else fail with what was waited for and how things stood at last.

    Without ``what`` the condition's own text names it, and what it looks at is shown as it was at last.
    """
    deadline = time.monotonic() + timeout_s
    while not (answer := condition()):
        if time.monotonic() > deadline:
            last = seen() if seen else state_of(condition)
            name = what or text_of(condition)
            raise AssertionError(f"waited {timeout_s:g} s in vain for {name}: last answer {answer!r}, {last}")
        time.sleep(0.005)


def text_of(condition: Callable[[], object]) -> str:
    """Return the condition as it is written."""
    try:
        text = " ".join(inspect.getsource(condition).split())
    except (OSError, TypeError):
        text = repr(condition)
    return text if len(text) < 300 else f"{text[:300]}..."


def state_of(condition: Callable[[], object]) -> str:
    """Return what the condition looks at."""
    try:
        around = inspect.getclosurevars(condition).nonlocals
    except TypeError:
        return ""
    return ", ".join(f"{name} = {value!r:.300}" for name, value in around.items())
