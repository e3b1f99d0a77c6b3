"""Report of a benchmark: lines of figures, each with its target where there is one."""

import importlib.metadata
import os
import platform
import statistics
import sys
from collections.abc import Mapping, Sequence

from bench.timing import Ratio, Seconds

_LIBRARIES = ("numpy", "rawpy", "imagecodecs", "fastapi", "uvicorn", "httpx")


def say(line: str = "") -> None:
    print(line, flush=True)


def describe_machine() -> str:
    """The machine and the versions: figures mean nothing without them."""
    versions = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in _LIBRARIES)
    cores = len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count()
    busy = os.getloadavg()[0]
    return (
        f"{_processor()}, {cores} cores (load {busy:.1f} before the start), {platform.system()} "
        f"{platform.release()}, Python {platform.python_version()}\n{versions}"
    )


def show_times(seconds: Mapping[str, Seconds]) -> None:
    """One line a way: its median and the middle half."""
    for name, each in seconds.items():
        low, median, high = (1e3 * q for q in statistics.quantiles(each, n=4, method="inclusive"))
        say(f"  {name:<54} {median:8.1f} ms  ({low:.1f} to {high:.1f})")


def judge(text: str, ratio: Ratio, *, at_least: float | None = None, at_most: float | None = None) -> bool:
    """Print a ratio beside its target, and say whether it is met."""
    met = (at_least is None or ratio.median >= at_least) and (at_most is None or ratio.median <= at_most)
    target = f"at least {at_least:g}" if at_least is not None else f"at most {at_most:g}"
    say(f"  {text:<54} {ratio}  target: {target}  {'met' if met else 'MISSED'}")
    return met


def judge_seconds(text: str, seconds: Seconds, *, at_most_s: float) -> bool:
    """Print the median of some times beside its target, and say whether it is met."""
    median_s = statistics.median(seconds)
    met = median_s <= at_most_s
    say(f"  {text:<54} {median_s:.2f} s  target: at most {at_most_s:g} s  {'met' if met else 'MISSED'}")
    return met


def summarise(verdicts: Sequence[bool]) -> str:
    missed = len(verdicts) - sum(verdicts)
    return f"{len(verdicts)} targets, {missed} MISSED" if missed else f"{len(verdicts)} targets, all met"


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="ascii", errors="replace") as file:  # noqa: PTH123 (no path of ours)
            names = [line.partition(":")[2].strip() for line in file if line.startswith("model name")]
    except OSError:
        names = []
    return names[0] if names else platform.machine()
