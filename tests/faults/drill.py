"""One row of the matrix: work in peace, work under a fault, and what is left of it."""

import time
import uuid
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Literal

from sqlalchemy import select

from store.tables import Campaign, Job
from tests.faults.grounds import Ground
from tests.faults.load import Load, prepare, salted
from tests.faults.verdict import Truth, Verdict, judge, take_truth
from tests.faults.watching import Watch
from tests.support.fieldwork import Shot

Kind = Literal["embedded", "composed"]
BOTH: tuple[Kind, ...] = ("embedded", "composed")
# Beyond the longest pause between two attempts of a job, a minute, and the time of a lost lease.
_RECOVERS_WITHIN_S = 240.0
_ANSWERS_WITHIN_S = 2.0
_NOTICED_WITHIN_S = 4.0


@dataclass(frozen=True, kw_only=True)
class Fault:
    """One fault: what it does, how long it lasts, and what must hold beside nothing lost, doubled or wrong.

    ``strike`` is a context in which the fault lasts; it fails where the fault did not really strike.
    """

    name: str
    strike: Callable[["Drill"], AbstractContextManager[object]] = nullcontext
    on: tuple[Kind, ...] = BOTH
    lasts_s: float = 0.0
    needs: Literal["", "disk", "clock", "pair"] = ""
    readyz: int | None = None
    """What it must answer while the fault lasts; None where it is not asked."""
    livez: bool = False
    """Whether the service must say meanwhile that it lives."""
    goes_on_within_s: float = _RECOVERS_WITHIN_S
    """From the end of the fault to the next job that ends."""
    no_errors: bool = False
    """Whether a user of the client must not see any."""
    slow: bool = False
    """Whether files are large and sent slowly, while versions are looked up."""
    refuses: frozenset[str] = frozenset()
    """Codes of lasting refusals that are right while the fault lasts."""
    sends_again: bool = False
    """Whether everything is asked for again afterwards, as after a restored backup."""
    in_tests: tuple[Kind, ...] = ()


@dataclass(kw_only=True)
class Row:
    fault: str
    kind: str
    frames: int = 0
    verdict: Verdict = field(default_factory=Verdict)
    errors: int = 0
    """That users of the client saw."""
    goes_on_s: float | None = None
    all_done_s: float | None = None
    told: str = ""
    complaints: list[str] = field(default_factory=list)
    skipped: str = ""

    @property
    def holds(self) -> bool:
        found = self.verdict
        return not (found.lost or found.twice or found.wrong or self.complaints)


@dataclass(kw_only=True)
class Drill:
    ground: Ground
    load: Load
    rng: Random
    folder: Path
    lasts_s: float
    organisation_id: str

    def jobs(self, *states: str) -> list[Job]:
        wanted = select(Job).where(Job.organisation_id == self.organisation_id, Job.state.in_(states))
        with self.ground.database.reading() as session:
            return list(session.scalars(wanted))

    def wait_until_at_work(self) -> None:
        """Wait until a job runs, with others behind it."""
        self.ground.wait_until(lambda: self.jobs("running"), "a job that runs", timeout_s=60)

    def pause(self, seconds: float) -> None:
        """Let time pass, in which what dies is started again by whoever does so."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.ground.look_after()
            time.sleep(0.05)


def run_row(
    fault: Fault,
    ground: Ground,
    *,
    beside: str,
    base: Sequence[Shot],
    card: Sequence[Shot],
    folder: Path,
    seed: int,
    truth: Truth | None,
) -> tuple[Row, Truth]:
    """Drill one fault on one deployment; without a truth this run, which must be undisturbed, gives it."""
    rng = Random(f"{seed}-{fault.name}-{ground.kind}")
    row = Row(fault=fault.name, kind=ground.kind)
    salt = str(uuid.uuid4())
    base = salted(base, folder / "base", f"base-{salt}", large=False)
    card = salted(card, folder / "card", salt, large=fault.slow)
    with ground.team() as team, ground.team() as stranger:
        load = Load(team, prepare(team, base), card, rng, slow=fault.slow)
        with ground.database.reading() as session:
            organisation_id = session.get_one(Campaign, load.campaign.id).organisation_id
        drill = Drill(
            ground=ground,
            load=load,
            rng=rng,
            folder=folder,
            lasts_s=fault.lasts_s,
            organisation_id=organisation_id,
        )
        with Watch(ground.url, beside, lambda: ground.database, frozenset({organisation_id})) as watch, load:
            began, ended = _strike(fault, drill)
            _finish(fault, drill, row)
            row.all_done_s = max(0.0, time.monotonic() - ended)
        row.goes_on_s = watch.first_end_after(ended)
        row.told = _told(fault, watch, began, ended, row)
        row.frames = len(base) + len(card)
        row.errors = len(load.troubles)
        if fault.no_errors:
            row.complaints += [f"a user saw {trouble.code} ({trouble.asked})" for trouble in load.troubles]
        row.complaints += [
            f"a passing fault was called lasting: {trouble.code} ({trouble.asked})"
            for trouble in load.troubles
            if not trouble.retryable and trouble not in load.refused and trouble.code not in fault.refuses
        ]
        truth = truth or take_truth(load, card)
        row.verdict = judge(load, card, truth, database=ground.database, stranger=stranger)
    if row.goes_on_s is not None and row.goes_on_s > fault.goes_on_within_s:
        row.complaints.append(f"went on only after {row.goes_on_s:.1f} s")
    return row, truth


def _strike(fault: Fault, drill: Drill) -> tuple[float, float]:
    # Something has been acknowledged, and most has not.
    moment = drill.rng.randint(1, 4)
    drill.ground.wait_until(
        lambda: drill.load.answered >= moment, f"{moment} answers before the fault", timeout_s=90
    )
    began = time.monotonic()
    with fault.strike(drill):
        began = time.monotonic()
        drill.pause(fault.lasts_s)
    if fault.sends_again:
        drill.load.ask_all()
    return began, time.monotonic()


def _finish(fault: Fault, drill: Drill, row: Row) -> None:
    try:
        drill.ground.wait_until(
            lambda: not drill.load.unanswered(),
            f"answers to all that was asked under the fault: {fault.name}",
            timeout_s=_RECOVERS_WITHIN_S,
            seen=lambda: (sorted(drill.load.unanswered()), drill.load.troubles[-3:]),
        )
        drill.ground.wait_until(
            lambda: not drill.jobs("queued", "running"),
            f"the end of all jobs after the fault: {fault.name}",
            timeout_s=_RECOVERS_WITHIN_S,
            seen=lambda: [
                (job.id, job.kind, job.state, job.error) for job in drill.jobs("queued", "running")
            ],
        )
    except AssertionError as error:
        row.complaints.append(str(error)[:1500])


def _told(fault: Fault, watch: Watch, began: float, ended: float, row: Row) -> str:
    """Whether the health routes said how it was, once there was time to notice."""
    if fault.readyz is None and not fault.livez:
        return ""
    asked = {"readyz": fault.readyz, "livez": 200 if fault.livez else None}
    wrong = []
    for route, status in asked.items():
        if status is None:
            continue
        when = began + _NOTICED_WITHIN_S, ended - 0.5
        probes = watch.seen(route, *when)
        if not probes:
            wrong.append(f"/{route} was not seen")
        if others := {probe.status for probe in probes} - {status}:
            wrong.append(f"/{route} answered {sorted(others)}, not {status}")
        slowest_s = watch.slowest_s(route, *when)
        machine_s = watch.slowest_s("bystander", *when)
        if slowest_s > _ANSWERS_WITHIN_S + machine_s:
            wrong.append(f"/{route} took {slowest_s:.1f} s, a bystander at most {machine_s:.1f} s")
    row.complaints += wrong
    return "no" if wrong else "yes"
