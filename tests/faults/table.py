"""The matrix: every fault that is drilled, and what must hold beside nothing lost, doubled or wrong."""

from collections.abc import Iterator

from store.settings import Settings
from tests.faults import strikes
from tests.faults.drill import Fault
from tests.support.proxy import Mode

LEASE_S: float = Settings.model_fields["lease_s"].default
_EMBEDDED, _COMPOSED = (("embedded",), ("composed",))
HASTEN = 4.0
"""By how much shorter faults last in the tests."""
_MODES: tuple[tuple[Mode, str, float, int | None], ...] = (
    ("silent", "is silent", 30.0, 503),
    ("slow", "is slow", 20.0, None),
    ("failing", "fails", 20.0, 503),
    ("away", "is away for ten minutes", 600.0, 503),
)


def _peers() -> Iterator[Fault]:
    for peer, name in (("database", "the database"), ("s3", "S3")):
        for mode, what, lasts_s, readyz in _MODES:
            yield Fault(
                name=f"{name} {what}",
                strike=strikes.peer(peer, mode),
                on=_COMPOSED,
                lasts_s=lasts_s,
                readyz=readyz,
                livez=True,
                in_tests=_COMPOSED if (peer, mode) == ("s3", "failing") else (),
            )


QUIET = Fault(name="nothing")

FAULTS: tuple[Fault, ...] = (
    QUIET,
    Fault(name="the worker is killed twice", strike=strikes.killed("worker", 2), in_tests=_COMPOSED),
    Fault(name="the service is killed", strike=strikes.killed("service")),
    Fault(
        name="Valkey is killed", strike=strikes.killed("valkey"), goes_on_within_s=10.0, in_tests=_COMPOSED
    ),
    Fault(name="decoders are killed", strike=strikes.decoders_killed),
    Fault(name="the broker is flushed", strike=strikes.broker_flushed),
    Fault(name="the broker is stopped", strike=strikes.frozen_valkey, lasts_s=20.0, livez=True),
    Fault(name="every message comes three times", strike=strikes.messages_three_times),
    Fault(name="the worker is frozen past its lease", strike=strikes.frozen_past_its_lease(LEASE_S)),
    Fault(name="all processes are killed twice", strike=strikes.tree_killed_twice),
    Fault(name="the database is locked", strike=strikes.database_locked, lasts_s=40.0, livez=True),
    Fault(name="the disk is full", strike=strikes.disk_full, lasts_s=150.0, needs="disk", livez=True),
    Fault(name="the clock goes back by an hour", strike=strikes.clock_set(-3600), needs="clock"),
    Fault(name="the clock goes forward by an hour", strike=strikes.clock_set(3600), needs="clock"),
    Fault(
        name="stored files rot",
        strike=strikes.bit_rot,
        refuses=frozenset({"stored_file_damaged"}),
        in_tests=_EMBEDDED,
    ),
    Fault(name="the worker is stopped amid a transaction", strike=strikes.stopped_amid_a_transaction),
    Fault(name="the service hangs", strike=strikes.hung("service")),
    Fault(name="the worker hangs", strike=strikes.hung("worker")),
    Fault(
        name="a backup is restored",
        strike=strikes.restored,
        refuses=frozenset({"not_found"}),
        sends_again=True,
        in_tests=_EMBEDDED,
    ),
    Fault(name="all is restarted politely", strike=strikes.restarted_politely, no_errors=True, slow=True),
    Fault(
        name="each part is restarted in turn",
        strike=strikes.restarted_in_turn,
        needs="pair",
        no_errors=True,
        slow=True,
    ),
    *_peers(),
)
