"""What is done to a deployment, each as a context in which it lasts. Each fails where it did not strike."""

import hashlib
import os
import signal
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress

import stilb
from store.jobs.queues import LANES, QUEUES, Message, Post
from tests.faults.drill import Drill
from tests.support.disks import filled
from tests.support.processes import alive, family
from tests.support.proxy import Mode

Strike = Callable[[Drill], AbstractContextManager[object]]
_HUNG_WITHIN_S = _STARTS_WITHIN_S = 240.0


def killed(part: str, times: int = 1) -> Strike:

    @contextmanager
    def strike(drill: Drill) -> Iterator[None]:
        for number in range(times):
            if number:
                drill.pause(drill.rng.uniform(0.5, 1.5))
            if part == "worker":
                drill.wait_until_at_work()
            drill.ground.kill(part)
        yield

    return strike


@contextmanager
def decoders_killed(drill: Drill) -> Iterator[None]:
    """Kill processes that read files, a few times, each as soon as it is seen."""
    killed: set[int] = set()

    def one_more() -> bool:
        found = [pid for pid in drill.ground.cells() - killed if alive([pid])]
        if found and drill.jobs("running"):
            victim = drill.rng.choice(sorted(found))
            with suppress(ProcessLookupError):
                os.kill(victim, signal.SIGKILL)
                killed.add(victim)
                return True
        return False

    for number in range(4):
        drill.ground.wait_until(one_more, f"a decoding process to kill, number {number + 1}", timeout_s=30)
    yield


@contextmanager
def broker_flushed(drill: Drill) -> Iterator[None]:
    """Forget every message, some of which are known to lie there."""
    broker = drill.ground.broker

    def some_forgotten() -> bool:
        # at once: at any moment the service sends another, or a worker in place of the stopped one takes it
        pipeline = broker.pipeline()
        for queue in QUEUES:
            pipeline.llen(queue)
        return any(pipeline.flushall().execute()[:-1])

    with drill.ground.stopped("worker"):
        drill.ground.wait_until(some_forgotten, "a message in the broker")
    yield


@contextmanager
def frozen_valkey(drill: Drill) -> Iterator[None]:
    with drill.ground.stopped("valkey"):
        yield


@contextmanager
def messages_three_times(drill: Drill) -> Iterator[None]:
    """Deliver two copies of each message beside the message, and another one after the job's end."""
    post, broker = Post(drill.ground.broker_url), drill.ground.broker
    with drill.ground.stopped("worker"):
        drill.ground.wait_until(lambda: drill.jobs("queued"), "a job that waits")
        jobs = drill.jobs("queued", "running")
        messages = [Message(LANES[job.lane], job.id, job.subject_id) for job in jobs]
        post.send(2 * messages)
    ended = {job.id for job in jobs}
    drill.ground.wait_until(
        lambda: not ended & {job.id for job in drill.jobs("queued", "running")}, "the end of these jobs"
    )
    post.send(messages)
    drill.ground.wait_until(lambda: not any(map(broker.llen, QUEUES)), "an empty broker")
    yield


def _send(pids: Iterable[int], number: int) -> None:
    for pid in pids:
        # it may have ended or been replaced meanwhile
        with suppress(ProcessLookupError):
            os.kill(pid, number)


def frozen_past_its_lease(lease_s: float) -> Strike:
    """Stop a worker and its pool at work for longer than their leases last, then let them go on."""

    @contextmanager
    def strike(drill: Drill) -> Iterator[None]:
        drill.wait_until_at_work()
        pids = family(drill.ground.pid("worker"))
        _send(pids, signal.SIGSTOP)
        drill.pause(1.5 * lease_s)
        _send(pids, signal.SIGCONT)
        yield

    return strike


@contextmanager
def stopped_amid_a_transaction(drill: Drill) -> Iterator[None]:
    """Stop the worker and its pool for good while one holds locks that all others wait for."""
    drill.wait_until_at_work()
    pid = drill.ground.pid("worker")

    def stopped() -> bool:
        pids = family(pid)
        _send(pids, signal.SIGSTOP)
        if drill.ground.is_amid_a_transaction(pids):
            return True
        _send(pids, signal.SIGCONT)
        return False

    drill.ground.wait_until(stopped, "a worker amid a transaction")
    yield
    drill.ground.wait_until_gone("worker", pid, _HUNG_WITHIN_S)


def hung(part: str) -> Strike:
    """Stop a part for good: it is to be noticed and replaced."""

    @contextmanager
    def strike(drill: Drill) -> Iterator[None]:
        if part == "worker":
            drill.wait_until_at_work()
        pid = drill.ground.pid(part)
        os.kill(pid, signal.SIGSTOP)
        try:
            yield
            drill.ground.wait_until_gone(part, pid, _HUNG_WITHIN_S)
        finally:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGCONT)

    return strike


@contextmanager
def tree_killed_twice(drill: Drill) -> Iterator[None]:
    for _ in range(2):
        drill.ground.kill_all()
        assert not drill.ground.serves()
        drill.ground.start_all()
        drill.pause(drill.rng.uniform(0.2, 1.0))
    yield


@contextmanager
def database_locked(drill: Drill) -> Iterator[None]:
    with drill.ground.locked():
        done = len(drill.jobs("succeeded")) if drill.ground.kind == "embedded" else 0
        yield
        if drill.ground.kind == "embedded":
            assert len(drill.jobs("succeeded")) == done, "work went on: the lock did not hold"


@contextmanager
def disk_full(drill: Drill) -> Iterator[None]:
    assert drill.ground.disk is not None
    with filled(drill.ground.disk):
        with drill.load.team.http() as http:
            path = f"/v1/campaigns/{drill.load.campaign.id}/frames?role=light"
            answer = http.post(path, content=os.urandom(1 << 20))
        assert answer.status_code == 507, f"an upload to a full disk answers {answer.status_code}"
        assert answer.json()["retryable"] is True
        yield


def clock_set(by_s: int) -> Strike:
    """Set the clock of all processes by so much, while a worker dies at work."""

    @contextmanager
    def strike(drill: Drill) -> Iterator[None]:
        clock = drill.ground.clock
        assert clock is not None
        drill.wait_until_at_work()
        clock.set(clock.shift_s + by_s)
        drill.ground.kill("worker")
        yield

    return strike


@contextmanager
def bit_rot(drill: Drill) -> Iterator[None]:
    """Zero a part of one stored file, flip a bit of another and remove a third; then send them again."""
    ground, load = drill.ground, drill.load
    names = drill.rng.sample(sorted(load.base.frames), 3)
    ways: list[Callable[[bytes], bytes | None]] = [_zeroed, _flipped, lambda _: None]
    for name, way in zip(names, ways, strict=True):
        frame = load.base.frames[name]
        good = ground.stored(frame.sha256)
        assert good is not None
        assert hashlib.sha256(good).hexdigest() == frame.sha256
        ground.overwrite(frame.sha256, way(good))
        assert ground.stored(frame.sha256) != good, "the file is as it was"
        _check_refused(drill, frame)
        (drill.folder / name).write_bytes(good)
        load.team.client.push(load.base.campaign.id, drill.folder / name, role=frame.role, scene=frame.scene)
        with load.team.http() as http:
            healed = http.get(f"/v1/frames/{frame.id}/content")
        assert healed.status_code == 200, f"sending it again did not heal it: {healed.text}"
        assert healed.content == good
        assert ground.stored(frame.sha256) == good
    yield


def _check_refused(drill: Drill, frame: stilb.Frame) -> None:
    with drill.load.team.http() as http:
        # A service may have noticed before the first byte, or only in the middle; it says so the next time.
        for _ in range(2):
            with suppress(stilb.Problem, Exception):
                http.get(f"/v1/frames/{frame.id}/content")
        answer = http.get(f"/v1/frames/{frame.id}/content")
        assert answer.status_code != 200, "damaged bytes are served"
        assert answer.json()["code"] == "stored_file_damaged", answer.text
        known = http.post(
            f"/v1/campaigns/{drill.load.base.campaign.id}/frames/known", json={"sha256": [frame.sha256]}
        )
        assert known.json()["known"] == [], "a damaged file is called known"


def _zeroed(content: bytes) -> bytes:
    middle = len(content) // 2
    return content[:middle] + bytes(2000) + content[middle + 2000 :]


def _flipped(content: bytes) -> bytes:
    middle = len(content) // 3
    return content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]


@contextmanager
def restored(drill: Drill) -> Iterator[None]:
    """Back up at work, go on for a while, lose the machine, and begin anew from the backup."""
    backup = drill.folder / "backup"
    backup.mkdir()
    drill.ground.back_up(backup)
    drill.pause(2.0)
    drill.ground.kill_all()
    drill.ground.restore(backup)
    drill.ground.start_all()
    yield


@contextmanager
def restarted_politely(drill: Drill) -> Iterator[None]:
    drill.ground.stop_all()
    drill.ground.start_all()
    yield


@contextmanager
def restarted_in_turn(drill: Drill) -> Iterator[None]:
    """Two rounds of asking one part after the other to end; of two services one is always there."""
    for _ in range(2):
        for name in drill.ground.ours:
            before = drill.ground.terminate(name)
            drill.ground.wait_until(
                lambda name=name, before=before: drill.ground.pid(name) != before, f"another {name}"
            )
            for service in drill.ground.services:
                drill.ground.wait_until(
                    lambda service=service: drill.ground.serves(service),
                    f"readiness of the {service}",
                    timeout_s=_STARTS_WITHIN_S,
                )
            drill.pause(1.0)
    assert drill.load.looked_up > 10, f"only {drill.load.looked_up} look-ups"
    yield


def peer(name: str, mode: Mode) -> Strike:
    """Let the database or the file store be so."""

    @contextmanager
    def strike(drill: Drill) -> Iterator[None]:
        proxy = drill.ground.proxies[name]
        struck = proxy.struck
        with proxy.being(mode):
            started = time.monotonic()
            yield
            missing = mode != "away" and proxy.struck == struck
            assert not missing, f"nobody asked {name} within {time.monotonic() - started:.0f} s"

    return strike
