"""Time in which a loop was awake: while it was stopped by a signal, or with its machine, none goes by."""

import time
from collections.abc import Callable


class AwakeClock:
    """Seconds that add up from turn to turn of a loop, of each turn at most `longest_turn_s`.

    Whoever measures others against its own clock must not hold against them the time in which it did not run
    itself: they did not run either, or could not tell it.
    """

    def __init__(self, longest_turn_s: float, *, clock: Callable[[], float] = time.monotonic) -> None:
        self._longest_turn_s = longest_turn_s
        self._clock = clock
        self._turned = clock()
        self.now_s = 0.0

    def turn(self) -> float:
        """Count one turn of the loop and return the time."""
        now = self._clock()
        self.now_s += min(now - self._turned, self._longest_turn_s)
        self._turned = now
        return self.now_s
