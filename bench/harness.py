"""Taking turns, ratios with their targets, memory and CPU of processes, and a service to measure."""

import gc
import importlib.metadata
import os
import platform
import re
import secrets
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import httpx

from tests.support.ports import pick_port
from tests.support.waiting import wait_for

Seconds = list[float]
Ways = Mapping[str, Callable[[], object]]
KEY = f"stilb_{secrets.token_urlsafe(32)}"
HEADERS = {"Authorization": f"Bearer {KEY}"}
ROOT = Path(__file__).resolve().parent.parent
_LIBRARIES = ("numpy", "rawpy", "imagecodecs", "fastapi", "uvicorn", "httpx")


@dataclass(frozen=True, kw_only=True)
class Scale:
    """How large everything is: in earnest, or in a test."""

    rows: int = 3956
    cols: int = 5280
    rounds: int = 7
    uploads: int = 5
    grown: int = 10_000  # frames of a campaign, beside a hundredth of them
    jobs: int = 100_000
    coefficients: tuple[int, ...] = (2_000, 20_000)  # how many there are, one after the other
    lookups: int = 400  # look-ups of one turn
    starts: int = 2
    rests_s: float = 12.0
    workers: int = 20
    job_s: float = 1.0  # three such jobs a worker in a round
    card: int = 500
    restarts: int = 7


def take_turns(
    ways: Ways, *, rounds: int, warm_up: int = 2, prepare: Callable[[], None] = lambda: None
) -> dict[str, Seconds]:
    """Time every way once a round, in an order that rotates; ``prepare`` is called before each, untimed."""
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
        if self.low == self.high:
            return f"{self.median:.2f}"
        return f"{self.median:.2f} ({self.low:.2f} to {self.high:.2f})"


def compare(longer: Seconds, shorter: Seconds) -> Ratio:
    """Divide round by round."""
    ratios = [a / b for a, b in zip(longer, shorter, strict=True)]
    low, median, high = statistics.quantiles(ratios, n=4, method="inclusive")
    return Ratio(median=median, low=low, high=high)


def say(line: str = "") -> None:
    print(line, flush=True)


def show_times(seconds: Mapping[str, Seconds]) -> None:
    """One line a way: its median and the middle half."""
    for name, each in seconds.items():
        low, median, high = (1e3 * q for q in statistics.quantiles(each, n=4, method="inclusive"))
        say(f"  {name:<54} {median:8.1f} ms  ({low:.1f} to {high:.1f})")


def judge(
    text: str, found: Ratio | float, *, at_least: float | None = None, at_most: float | None = None
) -> bool:
    """Print a ratio or a figure beside its target, and say whether it is met."""
    ratio = found if isinstance(found, Ratio) else Ratio(found, found, found)
    met = (at_least is None or ratio.median >= at_least) and (at_most is None or ratio.median <= at_most)
    target = f"at least {at_least:g}" if at_least is not None else f"at most {at_most:g}"
    say(f"  {text:<54} {ratio}  target: {target}  {'met' if met else 'MISSED'}")
    return met


def summarise(verdicts: Sequence[bool]) -> str:
    missed = len(verdicts) - sum(verdicts)
    return f"{len(verdicts)} targets, {missed} MISSED" if missed else f"{len(verdicts)} targets, all met"


def describe_machine() -> str:
    """The machine and the versions: figures mean nothing without them."""
    versions = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in _LIBRARIES)
    found = re.search(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text())
    cores = f"{len(os.sched_getaffinity(0))} cores (load {os.getloadavg()[0]:.1f} before the start)"
    system = f"{platform.system()} {platform.release()}, Python {platform.python_version()}"
    return f"{found[1] if found else platform.machine()}, {cores}, {system}\n{versions}"


def read_memory_mb(pid: int, name: str) -> float:
    """`VmRSS`: now; `VmHWM`: at most since it was last reset."""
    return _read_kb(pid, "status", name) * 1024 / 1e6


def read_shared_mb(pid: int) -> float:
    """Return the memory of a process; a page that n processes share counts as 1 / n."""
    return _read_kb(pid, "smaps_rollup", "Pss") * 1024 / 1e6


def _read_kb(pid: int, file: str, name: str) -> float:
    text = Path(f"/proc/{pid}/{file}").read_text(encoding="ascii")
    found = re.search(rf"^{name}:\s+(\d+) kB", text, re.MULTILINE)
    return int(found[1]) if found else float("nan")


def forget_peak(pid: int) -> None:
    Path(f"/proc/{pid}/clear_refs").write_text("5", encoding="ascii")


def read_cpu_s(*pids: int) -> float:
    """Return the CPU time that processes have used; /proc counts it in hundredths of a second."""
    scheduled = 2
    return sum(time.clock_gettime(~pid << 3 | scheduled) for pid in pids)


@dataclass(frozen=True, kw_only=True)
class Service:
    """The HTTP side alone: a worker beside it would compete for the cores with what is measured."""

    url: str
    pid: int

    def open_http(self) -> httpx.Client:
        return httpx.Client(base_url=self.url, headers=HEADERS, timeout=600)


@contextmanager
def serving(data: Path, database_url: str | None = None, *, workers: int = 1) -> Iterator[Service]:
    """Run `python -m service` on a database, new unless one is there, without a broker: hints go nowhere."""
    data.mkdir(exist_ok=True)
    port = pick_port()
    environment = {
        **make_environment(data),
        "STILB_PORT": str(port),
        "STILB_KEY": KEY,
        "STILB_WORKERS": str(workers),
        "STILB_BROKER_URL": "redis://127.0.0.1:1/0",
        **({"STILB_DATABASE_URL": database_url} if database_url else {}),
    }
    subprocess.run([sys.executable, "-m", "store.migrate"], check=True, cwd=ROOT, env=environment)
    log = data / "service.log"
    with log.open("wb") as file, running(["-m", "service"], environment, file) as process:
        url = f"http://127.0.0.1:{port}"
        await_answer(f"{url}/readyz", log)
        yield Service(url=url, pid=process.pid)


def make_environment(data: Path) -> dict[str, str]:
    """Return this environment without its STILB_ settings, and with a data folder; code is kept compiled."""
    left_out = ("STILB_", "PYTHONDONTWRITEBYTECODE")
    return {k: v for k, v in os.environ.items() if not k.startswith(left_out)} | {"STILB_DATA": str(data)}


@contextmanager
def running(
    words: list[str], environment: Mapping[str, str], log: object
) -> Iterator["subprocess.Popen[bytes]"]:
    process = subprocess.Popen(
        [sys.executable, *words], cwd=ROOT, env=environment, stdin=subprocess.PIPE, stdout=log, stderr=log
    )  # type: ignore[call-overload]
    try:
        yield process
    finally:
        process.terminate()
        process.communicate()


def await_answer(url: str, log: Path) -> None:
    def answers() -> bool:
        with suppress(httpx.TransportError):
            return httpx.get(url, timeout=5).is_success
        return False

    wait_for(answers, url, timeout_s=180.0, seen=lambda: log.read_text(errors="replace")[-2000:])
