"""Measuring several ways of doing the same thing, turn by turn."""

import gc
import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

Seconds = list[float]


def take_turns(
    ways: Mapping[str, Callable[[], object]],
    *,
    rounds: int,
    warm_up: int = 2,
    prepare: Callable[[], None] = lambda: None,
) -> dict[str, Seconds]:
    """Time every way once a round, in an order that rotates: whatever disturbs a round disturbs all of it.

    ``prepare`` : called before each call, and not timed
    """
    names = list(ways)
    for name in names * warm_up:
        prepare()
        ways[name]()
    seconds: dict[str, Seconds] = {name: [] for name in names}
    gc.collect()
    gc.disable()
    try:
        for number in range(rounds):
            turn = number % len(names)
            for name in names[turn:] + names[:turn]:
                prepare()
                began = time.perf_counter()
                ways[name]()
                seconds[name].append(time.perf_counter() - began)
    finally:
        gc.enable()
    return seconds


@dataclass(frozen=True)
class Ratio:
    """How many times longer one way takes than another: the middle of the rounds, and the middle half."""

    median: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.median:.2f} ({self.low:.2f} to {self.high:.2f})"


def compare(longer: Seconds, shorter: Seconds) -> Ratio:
    """Divide round by round."""
    ratios = [a / b for a, b in zip(longer, shorter, strict=True)]
    low, median, high = statistics.quantiles(ratios, n=4, method="inclusive")
    return Ratio(median=median, low=low, high=high)
