"""Waiting for something that is about to happen: never for ever, and by name."""

import inspect
import ssl
import time
from collections.abc import Callable

import httpx

PATIENCE_S = 90.0
# none is needed, and to make one for each request takes thirty times what the request takes
NO_TLS = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)


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
    began = time.monotonic()
    while not (answer := condition()):
        waited_s = time.monotonic() - began
        if waited_s > timeout_s:
            last = seen() if seen else state_of(condition)
            name = what or text_of(condition)
            raise AssertionError(f"waited {timeout_s:g} s in vain for {name}: last answer {answer!r}, {last}")
        # who asks all the time keeps a processor from those who work
        time.sleep(min(0.1, 0.005 + waited_s / 20))


def status_of(url: str, *, timeout_s: float = 5.0) -> int:
    """Return the status of an answer; 0 where there is none."""
    try:
        return httpx.get(url, timeout=timeout_s, verify=NO_TLS).status_code
    except httpx.TransportError:
        return 0


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
